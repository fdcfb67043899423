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
from enliven.document import Constraint, ExampleSettings, list_names_in
from enliven.errors import InputError
from enliven.examples.poses import Examples
from enliven.examples.spacetime.bounded import BoundedQuadratics
from enliven.examples.spacetime.constraints import Conditions, convert_constraints
from enliven.examples.spacetime.nearest import Nearest
from enliven.examples.spacetime.spacetime import Solution, solve

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
            known: (F, P, 3) metres, an earlier solution with fewer constraints. Points without constraints
                are copied from it instead of being solved again.

        Returns:
            (F, P, 3) metres in the mesh's own frame.

        Raises:
            InputError: if poses have a wrong shape or are not finite (the message lists the frames), or if
                constraints contradict one another.
        """
        poses = self.check_poses(poses)
        conditions = convert_constraints(constraints, self.examples, len(poses), step)
        if known is None:
            return self.convert_to_metres(self.solve_checked_poses(poses, conditions, step, workers).places)
        constrained_points = sorted(
            {
                self.examples.find_point(name)
                for constraint in constraints
                for name in list_names_in(constraint)
            }
        )
        solution_m = self.convert_to_metres(
            self.solve_checked_poses(poses, conditions, step, workers, constrained_points).places
        )
        other_points = np.setdiff1d(np.arange(solution_m.shape[1]), constrained_points)
        solution_m[:, other_points] = known[:, other_points]
        return solution_m

    def check_poses(self, poses: Float) -> Float:
        """Returns the poses (F, P, 3) after checking their shape and values."""
        poses = np.asarray(poses, np.float64)
        pairs = len(self.examples.points)
        if poses.ndim != 3 or poses.shape[1:] != (pairs, 3) or len(poses) == 0:
            raise InputError(
                f"the poses have the shape {poses.shape}, expected (frames, {pairs}, 3)",
                where=_ERROR_PLACE,
                remedy="Pass one position of each paired joint in each frame.",
            )
        is_bad = ~np.isfinite(poses).all((1, 2))
        if is_bad.any():
            frames_text = ", ".join(map(str, np.flatnonzero(is_bad)[:8])) + (
                ", ..." if is_bad.sum() > 8 else ""
            )
            advice = "Remove these frames, or fill in the missing positions."
            raise InputError(
                f"{int(is_bad.sum())} frames contain numbers that are not finite: {frames_text}",
                where=_ERROR_PLACE,
                remedy=advice,
            )
        return poses

    def compute_nodes(self, poses: Float) -> BoundedQuadratics:
        """Returns the nodes of all control points at each frame of poses (F, P, 3)."""
        return Nearest(self.examples, self.settings, poses).nodes(range(len(self.examples.points)))

    def solve_checked_poses(
        self,
        poses: Float,
        conditions: Conditions,
        step: float,
        workers: Executor | None = None,
        only: Sequence[int] | None = None,
    ) -> Solution:
        """Solves poses that were already checked. Returns positions in units of the mesh's size. If ``only``
        is given, only these points are solved.
        """
        # Scale the weight, so that equal accelerations (per second squared) have equal costs at any frame
        # rate.
        weight = self.settings.acceleration / (step * self.settings.rate) ** 2
        bounds = -self.settings.margin, 1.0 + self.settings.margin
        nearest = Nearest(self.examples, self.settings, poses)
        return solve(nearest.nodes, conditions, weight, bounds, workers, only)

    def convert_to_metres(self, places: Float) -> Float:
        """Converts positions (P, F, 3) in units of the mesh's size to (F, P, 3) metres in the mesh's
        frame.
        """
        middle = self.examples.targets.mean(0)
        return np.asarray(np.swapaxes(places, 0, 1) * self.examples.target_size + middle)
