"""A coarse proxy of a surface that solves large bends at once. The fine surface alone would need hundreds of
frames.

Alternating between rotations and positions propagates a bend by about one edge per iteration. On ten thousand
vertices, an arm takes hundreds of iterations. A proxy of a few hundred vertices bends at once, and moves the
fine surface with it (:mod:`enliven.deformation.arap.detail`). After that, only the details of the fine
surface have to converge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Float, Int
from enliven.deformation.arap.coarse import sample_coarse_surface
from enliven.deformation.arap.detail import carry
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
"""Number of iterations of the proxy per frame. The proxy is small, so more iterations than on the fine
surface cost little."""
_MIN_PROXY_FOLLOW = 0.01
"""Minimum ``ArapSettings.follow`` of the proxy. If the handles' motion is rigid except for this fraction, the
whole proxy moves with the handles."""


class Guide:
    """A coarse proxy that carries a mesh: a solver on a few hundred of its vertices.

    Args:
        fine: the solver of the mesh.
        held: (P,) the vertex of each control point.
        weights: (P,) weight of each control point as a soft handle. None means hard.

    Attributes:
        carried: (V, 3) metres, the mesh as carried by the proxy.
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

    def take(self, fine: ArapSolver, places: Float) -> None:
        """Carries the fine surface with the handles from their last places to ``places`` (P, 3) metres.

        Offsets of the fine surface from the proxy rotate by the best rotation of all handles.

        Raises:
            InputError: if the places have the wrong shape, or are not finite; nothing has changed then.
        """
        self._solver.solve(targets_from_places(places))
        turn, _, _ = fit_rigid_motion(self._places, places)
        before, self.carried, self._places = self.carried, self._carried_vertices(), places
        fine.move_with_proxy(before, self.carried, turn)

    def settle(self, places: Float) -> Float:
        """Returns (V, 3) metres, the mesh moved from rest to ``places`` in small steps, independent of
        earlier frames.
        """
        settle_from_rest(self._solver, self._home, places)
        self.carried, self._places = self._carried_vertices(), places
        return self.carried

    @property
    def pressure(self) -> float:
        """The pressure that preserves the proxy's volume; it does not depend on the resolution."""
        return self._solver.pressure

    def _carried_vertices(self) -> Float:
        out, coarse = np.empty_like(self._rest), self._coarse
        maps = self._solver.maps()
        carry(maps, coarse.start, coarse.near, coarse.weights, self._rest, out, 0, len(out))
        return out

    def twin(self) -> Guide:
        """Returns a second guide at rest that shares the factor and the weights."""
        other = object.__new__(Guide)
        other.__dict__.update(self.__dict__)
        other._solver, other._places, other.carried = self._solver.twin(), self._home, self._rest
        return other


def settle_from_rest(solver: ArapSolver, home: Float, places: Float) -> None:
    """Moves a solver from rest to ``places`` (P, 3) in small steps, and lets it converge.

    A limb that rotates far in one step would turn inside out. The rigid motion that all handles share is
    applied in the last step. Spread over the steps, it would press the figure through its own middle.
    """
    solver.reset()
    turn, old, new = fit_rigid_motion(home, places)
    near = (places - new) @ turn + old
    for step in range(1, _PATH_STEPS + 1):
        solver.solve(targets_from_places(home + (near - home) * (step / _PATH_STEPS)))
    for _ in range(_SETTLING_FRAMES):
        solver.solve()
    solver.solve(targets_from_places(places))


def handles_from_vertices(vertices: Int, weights: Sequence[float | None]) -> list[Handle]:
    """Returns one handle per control point, named by its number."""
    return [Handle(str(k), (int(v),), w) for k, (v, w) in enumerate(zip(vertices, weights, strict=True))]


def targets_from_places(places: Float) -> dict[str, Float]:
    """Returns the targets (P, 3) for :func:`handles_from_vertices`."""
    return {str(k): place[None] for k, place in enumerate(places)}


def fit_rigid_motion(home: Float, places: Float) -> tuple[Float, Float, Float]:
    """Returns the rotation (3, 3) and the two centres (3,) of the best rigid motion of points (P, 3)."""
    old, new = home.mean(0), places.mean(0)
    covariance = (places - new).T @ (home - old)
    # If all points lie on a line, the rotation about the line is undetermined. A tiny multiple of the
    # identity selects the smallest rotation.
    covariance += 1e-12 * max(float(np.abs(covariance).max()), 1e-300) * np.eye(3)
    return to_matrix(np.array(nearest_quaternion(covariance))), old, new
