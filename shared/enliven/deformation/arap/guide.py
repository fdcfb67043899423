"""A coarse proxy of a surface (the guide), which solves large bends quickly. The fine surface alone would
need hundreds of frames.

The ARAP iteration alternates between rotations and positions, and propagates a bend by about one edge per
iteration. With ten thousand vertices, an arm needs hundreds of iterations. A proxy of a few hundred vertices
bends within a frame, and moves the fine surface with it (:mod:`enliven.deformation.arap.detail`). After that,
only the details of the fine surface have to converge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Float, Int
from enliven.deformation.arap.coarse import sample_coarse_surface
from enliven.deformation.arap.detail import apply_vertex_maps
from enliven.deformation.arap.input import Handle
from enliven.deformation.arap.solver import ArapSolver
from enliven.meshes import Mesh
from enliven.rotation import nearest_quaternion, to_matrix

_PATH_STEPS = 24
"""Number of steps from rest to the handles' targets: about eight degrees per step for a limb that rotates by
180 degrees."""
_SETTLING_FRAMES = 40
"""Number of additional frames at the targets, in which the proxy converges."""
_PROXY_ITERATIONS = 6
"""Number of iterations of the proxy per frame. The proxy is small, so it can have more iterations than the
fine surface."""
_MIN_PROXY_FOLLOW = 0.01
"""Minimum ``ArapSettings.follow`` of the proxy. If the motion of the handles is rigid except for this
fraction, the whole proxy moves rigidly with the handles."""


class Guide:
    """A coarse proxy of a mesh: a solver on a few hundred of its vertices, which all other vertices follow.

    Args:
        fine: the solver of the mesh.
        held: (P,) the vertex of each control point.
        weights: (P,) weight of each control point as a soft handle. None means hard.

    Attributes:
        carried: (V, 3) metres, the mesh as moved by the proxy.
    """

    def __init__(
        self,
        fine: ArapSolver,
        held: Int,
        weights: Sequence[float | None],
    ) -> None:
        mesh, settings = fine.mesh, fine.settings
        faces = np.concatenate([mesh.faces, fine.joints[:, [0, 1, 1]]]).astype(np.int32)
        self._coarse = sample_coarse_surface(
            Mesh(mesh.vertices, faces, mesh.name), held, settings.guide_vertices
        )
        proxy_settings = replace(
            settings, iterations=_PROXY_ITERATIONS, follow=max(settings.follow, _MIN_PROXY_FOLLOW)
        )
        self._solver = ArapSolver(self._coarse.mesh, proxy_settings, self._coarse.links)
        self._solver.set_handles(handles_from_vertices(self._coarse.held, weights))
        self._rest, self._home, self._places = mesh.vertices, mesh.vertices[held], mesh.vertices[held]
        self.carried = mesh.vertices

    def move_surface(self, fine: ArapSolver, places: Float) -> None:
        """Moves the fine surface with the proxy while the handles move to ``places`` (P, 3) metres.

        The offsets of the fine surface from the proxy are rotated by the best rotation of all handles.

        Raises:
            InputError: if ``places`` has the wrong shape, or is not finite. In that case nothing has changed.
        """
        self._solver.solve(targets_from_places(places))
        rotation, _, _ = fit_rigid_motion(self._places, places)
        previous, self.carried, self._places = self.carried, self._deformed_vertices(), places
        fine.move_with_proxy(previous, self.carried, rotation)

    def solve_from_rest(self, places: Float) -> Float:
        """Returns the vertices (V, 3) in metres for handles at ``places`` (P, 3), independent of earlier
        frames.

        The handles are moved from rest in small steps.
        """
        settle_from_rest(self._solver, self._home, places)
        self.carried, self._places = self._deformed_vertices(), places
        return self.carried

    @property
    def pressure(self) -> float:
        """The pressure that preserves the proxy's volume. It does not depend on the resolution of the
        mesh."""
        return self._solver.pressure

    def _deformed_vertices(self) -> Float:
        out, coarse = np.empty_like(self._rest), self._coarse
        maps = self._solver.get_vertex_maps()
        apply_vertex_maps(maps, coarse.start, coarse.near, coarse.weights, self._rest, out, 0, len(out))
        return out

    def create_guide_at_rest(self) -> Guide:
        """Returns a second guide at rest that shares the factor and the weights."""
        second = object.__new__(Guide)
        second.__dict__.update(self.__dict__)
        second._solver, second._places, second.carried = (
            self._solver.create_solver_at_rest(),
            self._home,
            self._rest,
        )
        return second


def settle_from_rest(solver: ArapSolver, rest_places: Float, places: Float) -> None:
    """Moves a solver from rest to ``places`` (P, 3) in small steps, and lets it converge.

    A limb that rotates far in one step would turn inside out. The rigid motion that all handles share is
    applied only in the last step. If it were distributed over the steps, the surface would be pressed through
    itself.
    """
    solver.reset()
    rotation, home_centre, place_centre = fit_rigid_motion(rest_places, places)
    unrotated_places = (places - place_centre) @ rotation + home_centre
    for step in range(1, _PATH_STEPS + 1):
        solver.solve(
            targets_from_places(rest_places + (unrotated_places - rest_places) * (step / _PATH_STEPS))
        )
    for _ in range(_SETTLING_FRAMES):
        solver.solve()
    solver.solve(targets_from_places(places))


def handles_from_vertices(vertices: Int, weights: Sequence[float | None]) -> list[Handle]:
    """Returns one handle per control point, named by its number."""
    return [
        Handle(str(k), (int(vertex),), weight)
        for k, (vertex, weight) in enumerate(zip(vertices, weights, strict=True))
    ]


def targets_from_places(places: Float) -> dict[str, Float]:
    """Returns the target of each handle from :func:`handles_from_vertices`, given ``places`` (P, 3)
    metres."""
    return {str(k): place[None] for k, place in enumerate(places)}


def fit_rigid_motion(rest_places: Float, places: Float) -> tuple[Float, Float, Float]:
    """Returns the best rigid motion from ``rest_places`` to ``places`` (P, 3): a rotation (3, 3), and both
    centres (3,)."""
    home_centre, place_centre = rest_places.mean(0), places.mean(0)
    covariance = (places - place_centre).T @ (rest_places - home_centre)
    # If all points lie on a line, the rotation about this line is undetermined. Adding a tiny multiple of the
    # identity selects the smallest rotation.
    covariance += 1e-12 * max(float(np.abs(covariance).max()), 1e-300) * np.eye(3)
    return to_matrix(np.array(nearest_quaternion(covariance))), home_centre, place_centre
