"""Retargeting from a performer's poses to trajectories of control points (section 5).

mapping = ExampleMap(examples)
places = mapping.solve(performed(clip, examples.joints).poses, clip.step)                # (F, P, 3)
places = mapping.solve(poses, step, [Coupling("left foot", "right foot", frame=40)])
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor

import numpy as np

from enliven.arrays import Float
from enliven.document import Constraint, ExampleSettings, names_in
from enliven.errors import InputError
from enliven.examples.poses import Examples
from enliven.examples.spacetime import Conditions, Nearest, Nodes, Solution, convert_constraints, solve

_ERROR_PLACE = "poses"


class ExampleMap:
    """Maps poses of a performer to positions of control points, by examples."""

    def __init__(self, examples: Examples, settings: ExampleSettings | None = None) -> None:
        self.examples, self.settings = examples, settings or ExampleSettings()

    def solve(
        self,
        poses: Float,
        step: float,
        constraints: Sequence[Constraint] = (),
        *,
        workers: Executor | None = None,
        known: Float | None = None,
    ) -> Float:
        """Solves the trajectories of the control points.

        Args:
            poses: (F, P, 3) metres, the paired joints in the body frame.
            step: seconds between frames.
            constraints: hard constraints.
            workers: threads that share the control points.
            known: (F, P, 3) metres, a solution with fewer constraints. Points without constraints are copied
                from it and not solved again.

        Returns:
            (F, P, 3) metres in the mesh's own frame.

        Raises:
            InputError: for poses with a wrong shape or that are not finite (the message names the frames),
                and for constraints that contradict one another.
        """
        poses = self.checked(poses)
        conditions = convert_constraints(constraints, self.examples, len(poses), step)
        if known is None:
            return self.in_metres(self.solution(poses, conditions, step, workers).places)
        named = sorted(
            {self.examples.point(name) for constraint in constraints for name in names_in(constraint)}
        )
        out = self.in_metres(self.solution(poses, conditions, step, workers, named).places)
        other_points = np.setdiff1d(np.arange(out.shape[1]), named)
        out[:, other_points] = known[:, other_points]
        return out

    def checked(self, poses: Float) -> Float:
        """Returns the poses (F, P, 3) after checking their shape and values."""
        poses = np.asarray(poses, np.float64)
        pairs = len(self.examples.points)
        if poses.ndim != 3 or poses.shape[1:] != (pairs, 3) or len(poses) == 0:
            raise InputError(
                f"there are {poses.shape} for {pairs} pairs", where=_ERROR_PLACE, mend="Give (F, P, 3)."
            )
        bad = ~np.isfinite(poses).all((1, 2))
        if bad.any():
            which = ", ".join(map(str, np.flatnonzero(bad)[:8])) + (", ..." if bad.sum() > 8 else "")
            mend = "Leave these frames out, or fill them."
            raise InputError(
                f"{int(bad.sum())} frames are not finite: {which}", where=_ERROR_PLACE, mend=mend
            )
        return poses

    def nodes(self, poses: Float) -> Nodes:
        """Returns the nodes of all control points at each frame of poses (F, P, 3)."""
        return Nearest(self.examples, self.settings, poses).nodes(range(len(self.examples.points)))

    def solution(
        self,
        poses: Float,
        conditions: Conditions,
        step: float,
        workers: Executor | None = None,
        only: Sequence[int] | None = None,
    ) -> Solution:
        """Solves checked poses. Returns positions in sizes of the mesh, for the points in ``only``, or for
        all."""
        # Equal accelerations per second have equal costs at any frame rate.
        weight = self.settings.acceleration / (step * self.settings.rate) ** 2
        bounds = -self.settings.margin, 1.0 + self.settings.margin
        nearest = Nearest(self.examples, self.settings, poses)
        return solve(nearest.nodes, conditions, weight, bounds, workers, only)

    def in_metres(self, places: Float) -> Float:
        """Converts positions (P, F, 3) in sizes of the mesh to (F, P, 3) metres in the mesh's frame."""
        middle = self.examples.targets.mean(0)
        return np.asarray(np.swapaxes(places, 0, 1) * self.examples.target_size + middle)
