"""Measures how fast a surface follows its handles, compared with libigl on the same mesh, handles, targets
and energy.

Ten handles are far from each other, and five of them move. Each frame runs three iterations from the previous
frame's shape. Ours runs with squash and stretch (two shape states and the pose); the peers lack it and run
plain. Each frame is measured several times, alternating between ours and the peer's. The shortest time
counts, because other processes disturb it least. Open3D, which factorises in every call, is measured if it is
installed. The two largest meshes are those of a puppet, which we solve coarsely; libigl solves the whole
mesh, and only the smaller one.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import igl
import numpy as np
from figure import Figure
from plain_arap import bean

from enliven.arrays import Float, Int
from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.deformation.arap.input import Handle
from enliven.deformation.arap.solver import ArapSolver
from enliven.document.surface_settings import ArapSettings
from enliven.meshes.files import load_mesh
from enliven.meshes.mesh import Mesh

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data")) / "meshes"
MESHES = {
    "600": ("arap_sorkine/cactus_small.off", 620),
    "5k": ("libigl/armadillo.obj", 5000),
    "10k": ("libigl/armadillo.obj", 10_488),
    "50k": ("libigl/armadillo.obj", 50_000),
}
"""Real meshes, and the target number of vertices. Much larger meshes are decimated."""
LARGE = {"100k": 100_000, "1m": 1_000_000}
"""Generated meshes of a puppet."""
_HANDLES, _FRAMES, _REPEATS = 10, 24, 5
PEER = "libigl ARAP (the same spokes)"


def figures() -> Iterator[Figure]:
    """Yields a frame at four sizes, an iteration, a change of handles, and the change of volume."""
    for size in MESHES:
        mesh = make_mesh(size)
        held, path = sample_farthest_points(mesh), make_targets(mesh)
        ours, theirs = _time_frames(mesh, held, path)
        print(f"arap: {size} is {mesh.name!r} with {len(mesh.vertices)} vertices; libigl {theirs:.3f} ms")
        yield Figure(f"arap.frame_ms_{size}", ours, "ms", PEER, theirs / ours)
        if size == "10k":
            yield from _measure_parts(mesh, held, path)
        if size in ("600", "5k", "10k"):
            yield from _measure_open3d(size, mesh, held, path, ours)
    yield from _measure_puppets()
    yield from _measure_volumes()


def make_mesh(size: str) -> Mesh:
    """Returns the real mesh of about that size, scaled to one metre, or a generated mesh if it is missing."""
    name, count = MESHES[size]
    if not (DATA / name).exists():
        return bean(count)
    mesh = load_mesh(DATA / name).mesh
    faces = mesh.faces.astype(np.int64)
    if len(mesh.vertices) > 1.5 * count:
        vertices, faces = igl.decimate(mesh.vertices, faces, 2 * count - 4)[:2]
        mesh = Mesh(vertices, faces.astype(np.int32), mesh.name)
    return Mesh(mesh.vertices / np.ptp(mesh.vertices, axis=0).max(), mesh.faces, Path(name).stem)


def sample_farthest_points(mesh: Mesh) -> Int:
    """Returns (10,) vertices by farthest-point sampling."""
    chosen, apart = [0], np.full(len(mesh.vertices), np.inf)
    for _ in range(_HANDLES - 1):
        apart = np.minimum(apart, np.linalg.norm(mesh.vertices - mesh.vertices[chosen[-1]], axis=1))
        chosen.append(int(apart.argmax()))
    return np.array(chosen)


def make_targets(mesh: Mesh) -> list[Float]:
    """Returns (10, 3) targets for each frame: five handles swing by a tenth of the mesh's size."""
    home, out = mesh.vertices[sample_farthest_points(mesh)], []
    for frame in range(_FRAMES):
        swing = 0.1 * np.sin(0.2 * frame + np.arange(_HANDLES))[:, None] * [1.0, 0.5, 0.2]
        out.append(home + np.where(np.arange(_HANDLES)[:, None] % 2 == 0, swing, 0.0))
    return out


def make_solver(mesh: Mesh, held: Int, settings: ArapSettings | None = None) -> ArapSolver:
    """Returns our solver with a hard handle at each vertex, named by its number in ``held``."""
    solver = ArapSolver(mesh, settings)
    solver.set_handles([Handle(str(k), (int(v),)) for k, v in enumerate(held)])
    return solver


def _time_frames(mesh: Mesh, held: Int, path: list[Float]) -> tuple[float, float]:
    """Returns the median milliseconds per frame, ours and libigl's."""
    solver, data = make_solver(mesh, held), igl.ARAPData()
    data.energy, data.max_iter = igl.ARAP_ENERGY_TYPE_SPOKES, 3
    igl.arap_precomputation(mesh.vertices, mesh.faces.astype(np.int64), 3, held.astype(np.int32), data)
    ours, theirs = [], []
    for _ in range(_REPEATS):
        solver.reset()
        ours.append(_time_each(lambda at: solver.solve(_name_targets(at)), path))
        state = [mesh.vertices]

        def peer(at: Float, state: list[Float] = state) -> None:
            state[0] = igl.arap_solve(at, data, state[0])

        theirs.append(_time_each(peer, path))
    return float(np.median(np.min(ours, 0))), float(np.median(np.min(theirs, 0)))


def _name_targets(at: Float) -> dict[str, Float]:
    """Returns the moving handles' targets by name."""
    return {str(k): at[k] for k in range(0, _HANDLES, 2)}


def _time_each(step: Callable[[Float], object], path: list[Float]) -> list[float]:
    """Returns the milliseconds of each frame."""
    out = []
    for at in path:
        start = time.perf_counter()
        step(at)
        out.append(1e3 * (time.perf_counter() - start))
    return out


def _measure_parts(mesh: Mesh, held: Int, path: list[Float]) -> Iterator[Figure]:
    """Yields one iteration (from plain frames of 13 and of 3), and adding and removing a handle."""
    least = []
    for iterations in (3, 13):
        solver = make_solver(mesh, held, ArapSettings(iterations=iterations, squash_and_stretch=False))
        runs = [_time_each(lambda at, s=solver: s.solve(_name_targets(at)), path) for _ in range(_REPEATS)]
        least.append(float(np.median(np.min(runs, 0))))
    yield Figure("arap.iteration_ms_10k", (least[1] - least[0]) / 10, "ms")
    solver, times = make_solver(mesh, held), []
    fresh = np.setdiff1d(np.arange(0, len(mesh.vertices), 331), held)[:30]
    handles = list(solver.handles.values())
    for vertex in fresh:
        start = time.perf_counter()
        solver.set_handles([*handles, Handle("new", (int(vertex),))])
        times.append(1e3 * (time.perf_counter() - start))
        solver.set_handles(handles)
    data = igl.ARAPData()
    again = []
    for _ in range(3):
        start = time.perf_counter()
        igl.arap_precomputation(mesh.vertices, mesh.faces.astype(np.int64), 3, held.astype(np.int32), data)
        again.append(1e3 * (time.perf_counter() - start))
    ours = float(np.median(times))
    yield Figure("arap.handle_change_ms_10k", ours, "ms", "libigl's precomputation", min(again) / ours)


def _measure_open3d(size: str, mesh: Mesh, held: Int, path: list[Float], ours: float) -> Iterator[Figure]:
    """Yields Open3D's time per frame, if it is installed."""
    try:
        import open3d as o3d
    except (ImportError, OSError):
        print("arap: Open3D is not installed here")
        return
    shell = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(mesh.vertices), o3d.utility.Vector3iVector(mesh.faces)
    )
    times = _time_each(
        lambda at: shell.deform_as_rigid_as_possible(
            o3d.utility.IntVector(held.tolist()), o3d.utility.Vector3dVector(at), max_iter=3
        ),
        path[:4],
    )
    print(f"arap: Open3D on {size} takes {min(times):.1f} ms a frame, {min(times) / ours:.0f} times ours")
    yield Figure(f"arap.open3d_frame_ms_{size}", min(times), "ms", "ours", ours / min(times))


def _measure_puppets() -> Iterator[Figure]:
    """Yields a frame, the preparation, a converged pose and one additional control point, for large
    surfaces."""
    for size, count in LARGE.items():
        mesh = bean(count)
        held, path = sample_farthest_points(mesh), make_targets(mesh)
        start = time.perf_counter()
        surface = PuppetSurface(mesh, held)
        prepared = time.perf_counter() - start
        runs = [_time_each(surface.solve, path) for _ in range(3)]
        ours = float(np.median(np.min(runs, 0)))
        peer: tuple[str | None, float | None] = (None, None)
        if size == "100k":
            theirs = _time_igl_frames(mesh, held, path[:4])
            peer = (PEER, theirs / ours)
        yield Figure(f"arap.frame_ms_{size}", ours, "ms", *peer)
        yield Figure(f"arap.prepare_s_{size}", prepared, "s")
        yield Figure(f"arap.settle_ms_{size}", min(_time_each(surface.solve_from_rest, path[:4])), "ms")
        start = time.perf_counter()
        surface.set_control_points([*held.tolist(), 4321])
        yield Figure(f"arap.hold_s_{size}", time.perf_counter() - start, "s")


def _time_igl_frames(mesh: Mesh, held: Int, path: list[Float]) -> float:
    """Returns libigl's shortest time per frame, milliseconds."""
    data = igl.ARAPData()
    data.energy, data.max_iter = igl.ARAP_ENERGY_TYPE_SPOKES, 3
    igl.arap_precomputation(mesh.vertices, mesh.faces.astype(np.int64), 3, held.astype(np.int32), data)
    state = [mesh.vertices]

    def step(at: Float) -> None:
        state[0] = igl.arap_solve(at, data, state[0])

    return min(_time_each(step, path))


def _measure_volumes() -> Iterator[Figure]:
    """Yields the change of volume of a ball and a bean, compressed to 64 % and stretched to 136 % of their
    height."""
    for shape, tall in (("ball", 1.0), ("bean", 1.7)):
        mesh = bean(2000, tall)
        height = mesh.vertices[:, 1]
        ends = [
            np.flatnonzero(side * height > (side * height).max() - 0.03 * tall).tolist() for side in (1, -1)
        ]
        for way, by in (("squashed", -0.18), ("stretched", 0.18)):
            drift = {}
            for kind in (False, True):
                solver = ArapSolver(mesh, ArapSettings(squash_and_stretch=kind))
                solver.set_handles([Handle(str(k), tuple(end)) for k, end in enumerate(ends)])
                shift = np.array([0.0, by * tall, 0.0])
                for _ in range(40):
                    solved = solver.solve(
                        {
                            str(k): mesh.vertices[end] + side * shift
                            for k, (end, side) in enumerate(zip(ends, (1, -1), strict=True))
                        }
                    )
                drift[kind] = abs(_compute_volume(mesh, solved) / _compute_volume(mesh, mesh.vertices) - 1)
            yield Figure(
                f"arap.volume_drift_{way}_{shape}",
                drift[True],
                "of it",
                "plain ARAP",
                drift[False] / drift[True],
            )


def _compute_volume(mesh: Mesh, vertices: Float) -> float:
    a, b, c = (vertices[mesh.faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)
