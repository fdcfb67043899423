"""Redetection: detects a doubtful tracked person from scratch, spread over several frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.backoff import Backoff
from enliven_edge.tracking.detect.detection import detect_another, estimates_by_facing
from enliven_edge.tracking.detect.fitted_frame import Fit, FittedFrame
from enliven_edge.tracking.estimator.estimator import load_shipped_estimator
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import Observation
from enliven_edge.tracking.work_budget import Budget, BudgetedTask, Steps

_DOUBTFUL_COST = 8.5
"""Maximum cost of a frame in square centimetres per point. Above it the person is detected again from
scratch."""
_DOUBTFUL_EXPLAINED = 0.87
"""Minimum fraction of explained points. Below it a doubtful person is detected again, even if the network
agrees with the posture."""
_LIMB_JOINTS = 3
"""Number of joints of one limb: elbow, wrist and hand, or knee, ankle and foot."""
_MAX_COST_RATIO = 0.8
"""Maximum cost of a new detection relative to the present cost for it to be accepted. A smaller gain may be
chance."""
_FIRST_INTERVAL = 30
"""Initial number of frames between two detections of a doubtful person. A detection takes several frames.
Doubling the number of detections did not improve the results on the tuning, close and held-out films.
"""
_MAX_INTERVAL = 120
"""Maximum number of frames between two detections. The wait doubles up to this number while no better posture
is found."""
_WIDE_WIDTH_M = 0.25
"""Robust width in metres of the first fit of a detection to a later frame: about the movement of a fast hand
in a frame."""
_NO_AFFINITY, _NO_LANDMARKS = np.zeros((0, 0), np.float32), np.zeros((0, 5))


@dataclass(frozen=True)
class _Running:
    """A detection in progress.

    Attributes:
        task: the detection, which runs step by step.
        frame: the frame in which it began.
        cost: the cost of the ordinary fit to that frame.
    """

    task: BudgetedTask[Fit | None]
    frame: FittedFrame
    cost: float


class Redetector:
    """Detects one person again while the tracking is doubtful.

    A detection takes several frames. So a new one starts at most every second, less often while detections
    fail, and never while the network agrees with the posture.
    """

    def __init__(self, fitter: Fitter, height: float) -> None:
        self._fitter, self._height = fitter, height
        self._backoff = Backoff(_MAX_INTERVAL, first_interval=_FIRST_INTERVAL)
        self.has_known_lengths = False
        self._running: _Running | None = None

    @property
    def is_running(self) -> bool:
        """Returns True if a detection is in progress."""
        return self._running is not None

    def stop(self) -> None:
        """Stops the detection in progress."""
        self._running = None

    def advance(self, frame: FittedFrame, lengths: Float | None, budget: Budget) -> Fit | None:
        """Works on the detection. Returns its fit to this frame if that explains the frame much better.

        The detected posture belongs to an earlier frame. So it is also fitted to this frame, and must explain
        both frames better.

        Args:
            frame: the person in this frame.
            lengths: (12,) metres, the person's bone lengths if they are known.
            budget: limits the work in this frame.
        """
        cost = frame.total_cost((frame.posture, frame.report), self._height)
        is_due = self._backoff.is_due(cost)
        if self._running is None:
            if cost < _DOUBTFUL_COST:
                self._backoff.reset()
                return None
            if not is_due or _is_confirmed(frame):
                return None
            self._backoff.start()
            self.has_known_lengths = lengths is not None
            self._running = _Running(BudgetedTask(self._detect(frame, lengths)), frame, cost)
        running = self._running
        if not running.task.advance(budget):
            return None
        self._running = None
        fit = running.task.result
        if fit is not None and running.frame.total_cost(fit, self._height) > _MAX_COST_RATIO * running.cost:
            fit = None
        if fit is not None and running.frame is not frame:
            fit = self._carry_to_frame(fit[0], running.frame, frame)
            if frame.total_cost(fit, self._height) > _MAX_COST_RATIO * cost:
                fit = None
        self._backoff.record(cost, better=fit is not None)
        return fit

    def _detect(self, frame: FittedFrame, lengths: Float | None) -> Steps[Fit | None]:
        """Runs the network for each likely facing, then :func:`detect_another`.

        It is a generator that yields its costs.
        """
        observation, by_facing = _without_guides(frame.observation), None
        if frame.network_output is not None:
            network, pose = load_shipped_estimator(), observation.view.world_from_camera
            by_facing = yield from estimates_by_facing(network, frame.network_output.estimate, pose)
        steps = detect_another(
            self._fitter,
            observation,
            frame.network_output,
            frame.eye,
            self._height,
            frame.posture,
            by_facing,
            lengths,
        )
        return (yield from steps)

    def _carry_to_frame(self, posture: Posture, earlier: FittedFrame, frame: FittedFrame) -> Fit:
        """Moves a posture of an earlier frame with the person, and fits it to this frame.

        The first fit has a large robust width.
        """
        moved, observation = posture.copy(), _without_guides(frame.observation)
        moved.position = moved.position + (frame.posture.position - earlier.posture.position)
        wide, _ = self._fitter.fit(observation, moved, width=_WIDE_WIDTH_M)
        return self._fitter.fit(observation, wide)


def _without_guides(observation: Observation) -> Observation:
    """Returns the observation without the network's affinities and landmarks."""
    return observation.with_guides(_NO_AFFINITY, _NO_LANDMARKS)


def _is_confirmed(frame: FittedFrame) -> bool:
    """Returns True if the posture explains most of the frame and the network agrees with it, except for one
    limb.

    A single wrong limb needs no detection, because :class:`PoseRecovery` tries limbs in other places. Of 227
    detections that began in such frames of the tuning and close films, 12 were accepted. Six led to a better
    and six to a worse posture, by a few centimetres at most.
    """
    if frame.network_output is None or frame.report.explained <= _DOUBTFUL_EXPLAINED:
        return False
    return frame.count_disagreeing() <= _LIMB_JOINTS
