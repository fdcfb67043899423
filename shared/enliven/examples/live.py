"""Example-based retargeting during a live performance: frame by frame, with a fixed small lag.

Each new pose is solved together with the frames that are not shown yet. Shown frames are held fixed, so that
the motion never jumps back. The control points of a frame are returned ``lag`` frames after its pose, because
still later poses hardly change them. If a motion ends within the lag, its frames are exactly those of the
batch solution.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.examples.mapping import ExampleMap
from enliven.examples.spacetime import Conditions

_AFFECTED_FRAMES = 2
"""Number of shown frames that still affect an acceleration."""


class LiveExamples:
    """A solver that returns the control points while the performer moves.

    Args:
        mapping: the retargeting by the examples.
        step: seconds between frames.
        lag: number of frames from a pose to the return of its control points. 0 returns them at once.
    """

    def __init__(self, mapping: ExampleMap, step: float, lag: int = 3) -> None:
        if lag < 0:
            raise InputError(f"a lag of {lag} frames cannot be", where="live examples")
        self.mapping, self.lag = mapping, lag
        self._step = step
        pairs = len(mapping.examples.points)
        self._poses = np.empty((0, pairs, 3))
        self._out = np.empty((pairs, 0, 3))

    def push(self, pose: Float) -> Float | None:
        """Adds a pose (P, 3) in the body frame. Returns control points (P, 3), metres, of the pose ``lag``
        frames before.

        Returns None while too few poses have arrived.

        Raises:
            InputError: if the pose has a wrong shape or is not finite. The pose is then ignored.
        """
        poses = np.concatenate([self._poses, self.mapping.checked(np.asarray(pose, np.float64)[None])])
        held = self._out.shape[1]
        if len(poses) - held <= self.lag:
            self._poses = poses
            return None
        places = self._solve_points(poses)
        out = np.concatenate([self._out, places[:, held : held + 1]], axis=1)
        # Drop the oldest frames: no acceleration that is still to be solved depends on them.
        old = max(out.shape[1] - _AFFECTED_FRAMES, 0)
        self._poses, self._out = poses[old:], out[:, old:]
        return np.asarray(self.mapping.in_metres(places[:, held : held + 1])[0])

    def finish(self) -> Float:
        """Returns (L, P, 3) metres, the control points of the remaining frames, and resets the state."""
        held = self._out.shape[1]
        due = (
            self.mapping.in_metres(self._solve_points(self._poses)[:, held:])
            if len(self._poses)
            else self._poses
        )
        self._poses, self._out = self._poses[:0], self._out[:, :0]
        return due

    def _solve_points(self, poses: Float) -> Float:
        """Solves (P, F, 3) control points, in sizes of the mesh, for the frames that still affect an
        answer."""
        held = np.zeros((poses.shape[1], len(poses), 3), np.bool_)
        values = np.zeros(held.shape)
        held[:, : self._out.shape[1]] = True
        values[:, : self._out.shape[1]] = self._out
        none = np.zeros((0, 3), np.int64)
        conditions = Conditions(held, values, none, none, np.zeros(0))
        return self.mapping.solution(poses, conditions, self._step).places
