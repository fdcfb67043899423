"""Example-based retargeting during a live performance: frame by frame, with a fixed small lag.

Each new pose is solved together with the recent frames that have not returned their control points yet.
Frames that were already returned are fixed, so the motion never jumps back. The control points of a frame are
returned ``lag`` frames after its pose, because even later poses would hardly change them. If a motion is
shorter than the lag, its frames are exactly those of the batch solution.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.examples.mapping import ExampleMap
from enliven.examples.spacetime.constraints import Conditions

_AFFECTED_FRAMES = 2
"""Number of already returned frames that affect the accelerations of later frames."""


class LiveExamples:
    """An incremental solver that returns control points while the performer moves.

    Args:
        mapping: the map from poses to control points, defined by the examples.
        step: seconds between frames.
        lag: number of frames between a pose and the return of its control points. With 0 they are returned at
            once.
    """

    def __init__(self, mapping: ExampleMap, step: float, lag: int = 3) -> None:
        if lag < 0:
            raise InputError(f"the lag is {lag} frames, but must be at least 0", where="live examples")
        self.mapping, self.lag = mapping, lag
        self._step = step
        pairs = len(mapping.examples.points)
        self._poses = np.empty((0, pairs, 3))
        self._out = np.empty((pairs, 0, 3))

    def push(self, pose: Float) -> Float | None:
        """Adds a pose (P, 3) in the body frame, and returns the control points (P, 3), metres, of the pose
        ``lag`` frames earlier.

        Returns None while too few poses have arrived.

        Raises:
            InputError: if the pose has a wrong shape or is not finite. The pose is then ignored.
        """
        poses = np.concatenate([self._poses, self.mapping.check_poses(np.asarray(pose, np.float64)[None])])
        fixed_count = self._out.shape[1]
        if len(poses) - fixed_count <= self.lag:
            self._poses = poses
            return None
        places = self._solve_points(poses)
        solved = np.concatenate([self._out, places[:, fixed_count : fixed_count + 1]], axis=1)
        # Drop the oldest frames. The remaining accelerations do not depend on them.
        obsolete_count = max(solved.shape[1] - _AFFECTED_FRAMES, 0)
        self._poses, self._out = poses[obsolete_count:], solved[:, obsolete_count:]
        return np.asarray(self.mapping.convert_to_metres(places[:, fixed_count : fixed_count + 1])[0])

    def finish(self) -> Float:
        """Returns the control points (L, P, 3) of the remaining frames, metres, and resets the state."""
        fixed_count = self._out.shape[1]
        due = (
            self.mapping.convert_to_metres(self._solve_points(self._poses)[:, fixed_count:])
            if len(self._poses)
            else self._poses
        )
        self._poses, self._out = self._poses[:0], self._out[:, :0]
        return due

    def _solve_points(self, poses: Float) -> Float:
        """Solves the control points (P, F, 3) of all stored frames, in units of the mesh's size."""
        is_fixed = np.zeros((poses.shape[1], len(poses), 3), np.bool_)
        values = np.zeros(is_fixed.shape)
        is_fixed[:, : self._out.shape[1]] = True
        values[:, : self._out.shape[1]] = self._out
        none = np.zeros((0, 3), np.int64)
        conditions = Conditions(is_fixed, values, none, none, np.zeros(0))
        return self.mapping.solve_checked_poses(poses, conditions, self._step).places
