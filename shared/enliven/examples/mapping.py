"""The mapping from a performer's poses to trajectories of control points (section 5).

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
from enliven.examples.spacetime import Conditions, Nearest, Nodes, Solution, conditions_of, solve

_WHERE = "poses"


class ExampleMap:
    """Maps poses of a performer to places of control points, by examples."""

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
        """Trajectories of the control points.

        Args:
            poses: (F, P, 3) metres, the paired joints in the body frame.
            step: seconds between frames.
            constraints: that must hold.
            workers: threads to share the control points among.
            known: (F, P, 3) metres that were solved with fewer constraints: points that no constraint names
                are as there, and not solved again.

        Returns:
            (F, P, 3) metres in the mesh's own frame.

        Raises:
            InputError: for poses that do not fit or are not finite, with the frame, and for constraints that
                contradict one another.
        """
        poses = self.checked(poses)
        conditions = conditions_of(constraints, self.examples, len(poses), step)
        if known is None:
            return self.in_metres(self.solution(poses, conditions, step, workers).places)
        named = sorted({self.examples.point(name) for one in constraints for name in names_in(one)})
        out = self.in_metres(self.solution(poses, conditions, step, workers, named).places)
        others = np.setdiff1d(np.arange(out.shape[1]), named)
        out[:, others] = known[:, others]
        return out

    def checked(self, poses: Float) -> Float:
        """Poses (F, P, 3) that can be used."""
        poses = np.asarray(poses, np.float64)
        pairs = len(self.examples.points)
        if poses.ndim != 3 or poses.shape[1:] != (pairs, 3) or len(poses) == 0:
            raise InputError(
                f"there are {poses.shape} for {pairs} pairs", where=_WHERE, mend="Give (F, P, 3)."
            )
        bad = ~np.isfinite(poses).all((1, 2))
        if bad.any():
            which = ", ".join(map(str, np.flatnonzero(bad)[:8])) + (", ..." if bad.sum() > 8 else "")
            mend = "Leave these frames out, or fill them."
            raise InputError(f"{int(bad.sum())} frames are not finite: {which}", where=_WHERE, mend=mend)
        return poses

    def nodes(self, poses: Float) -> Nodes:
        """The nodes of all control points at each frame of poses (F, P, 3)."""
        return Nearest(self.examples, self.settings, poses).nodes(range(len(self.examples.points)))

    def solution(
        self,
        poses: Float,
        conditions: Conditions,
        step: float,
        workers: Executor | None = None,
        only: Sequence[int] | None = None,
    ) -> Solution:
        """Places in sizes of the mesh, for poses that were checked; of some points ``only``, or of all."""
        # The same cost for the same acceleration in a second, whatever the rate.
        weight = self.settings.acceleration / (step * self.settings.rate) ** 2
        bounds = -self.settings.margin, 1.0 + self.settings.margin
        nearest = Nearest(self.examples, self.settings, poses)
        return solve(nearest.nodes, conditions, weight, bounds, workers, only)

    def in_metres(self, places: Float) -> Float:
        """(F, P, 3) metres in the mesh's frame of places (P, F, 3) in sizes of the mesh."""
        middle = self.examples.targets.mean(0)
        return np.asarray(np.swapaxes(places, 0, 1) * self.examples.target_size + middle)
