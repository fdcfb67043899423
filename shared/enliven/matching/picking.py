"""Selects the match that is shown during a live performance, and accepts it (a state machine).

The best match changes with every small movement of the performer. So the shown match stays until another
match has been better by a margin for some time. The performer can also browse the ranking with a key. A match
is accepted by a command (key, pedal, voice) or by holding the pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from enliven.arrays import Float
from enliven.matching.matches import Match, Ranking
from enliven.settings import parameter, setting

_MAX_STILL_FRACTION = 0.12
"""Maximum movement while a pose is held, as a fraction of the longest branch. It allows for slight swaying of
the arms."""


@dataclass(frozen=True)
class PickingSettings:
    """Settings for replacing the shown match, and for accepting it."""

    REMOVED_SETTINGS: ClassVar = ("still_share",)

    margin: float = setting(
        0.03,
        "Another match replaces the shown one only if its score per branch is better by this amount. "
        "Raise it if matches flicker.",
        low=0.0,
        high=2.0,
    )
    patience: float = parameter(
        0.3, "Time for which another match must be better before it is shown.", unit="s", low=0.0, high=10.0
    )
    browsing: float = parameter(
        5.0,
        "Time after a manual choice before the shown match follows the pose again.",
        unit="s",
        low=0.0,
    )
    by_holding: bool = setting(False, "Accepts the shown match when the performer holds the pose.")
    still_seconds: float = setting(1.5, "Time for which the pose must be held.", unit="s", low=0.1, high=60.0)


@dataclass(frozen=True)
class Pick:
    """The match to show now.

    Attributes:
        match: the match to show, or None.
        place: rank of the match from 0, or -1 if the ranking omits it.
        held: elapsed fraction of the time to hold still, 0 to 1. It is 0 if ``by_holding`` is off.
        accepted: True if the match is accepted. It does not change until :meth:`Picker.reset`.
    """

    match: Match | None
    place: int
    held: float = 0.0
    accepted: bool = False


class Picker:
    """The selection of a match from the rankings of one matcher.

    A held pose accepts a match only if the performer has moved since the start or since the previous match.
    So a performer who only stands still accepts nothing.
    """

    def __init__(self, settings: PickingSettings | None = None) -> None:
        self.settings = settings or PickingSettings()
        self.reset()

    def reset(self) -> None:
        """Discards the shown and the accepted match. The performer must move before a held pose can accept a
        match."""
        self._shown: tuple[int, ...] | None = None
        self._ranking: Ranking | None = None
        self._beaten_since: float | None = None
        self._browsing_order: list[tuple[int, ...]] = []
        self._browsed_at: float | None = None
        self._anchor: Float | None = None
        self._still_since: float | None = None
        self._moved = False
        self._accepted: Match | None = None
        self._time = 0.0

    def update(self, ranking: Ranking, points: Float, seconds: float) -> Pick:
        """Processes a new frame.

        Args:
            ranking: the ranking of this frame.
            points: (m + 1, 3) metres, the points of the source that the ranking is based on.
            seconds: time of the frame on the sensor's clock.
        """
        self._time, self._ranking = seconds, ranking
        if self._accepted is not None:
            return Pick(self._accepted, self._find_shown_rank(), accepted=True)
        if not len(ranking):
            self._shown = None
            return Pick(None, -1)
        previously_shown = self._shown
        self._follow_best(ranking, seconds)
        progress = self._compute_held_fraction(points, seconds, previously_shown == self._shown)
        if self.settings.by_holding and progress >= 1.0:
            self.accept()
        return self.choose_current(progress)

    def choose_current(self, held: float = 0.0) -> Pick:
        """Returns the current match to show. May be called between frames, for example after a key press."""
        if self._accepted is not None:
            return Pick(self._accepted, self._find_shown_rank(), accepted=True)
        place = self._find_shown_rank()
        if self._ranking is None or place < 0:
            return Pick(None, -1)
        return Pick(self._ranking[place], place, held if self.settings.by_holding else 0.0)

    def cycle(self, step: int = 1) -> Pick:
        """Shows the next or previous match of the ranking, and wraps around at the ends.

        The order is that of the ranking at the first call, even if later frames have other rankings.
        """
        if self._ranking is not None and len(self._ranking) and self._accepted is None:
            if self._browsed_at is None or self._shown not in self._browsing_order:
                self._browsing_order = [self._ranking.identity(place) for place in range(len(self._ranking))]
            index = self._browsing_order.index(self._shown) if self._shown in self._browsing_order else -step
            self._shown = self._browsing_order[(index + step) % len(self._browsing_order)]
            self._browsed_at, self._beaten_since, self._still_since = self._time, None, None
        return self.choose_current()

    def accept(self) -> Match | None:
        """Accepts the shown match, and returns the accepted match, or None if none was shown."""
        self._accepted = self._accepted or self.choose_current().match
        return self._accepted

    def _find_shown_rank(self) -> int:
        if self._ranking is None or self._shown is None:
            return -1
        return self._ranking.find(self._shown)

    def _follow_best(self, ranking: Ranking, seconds: float) -> None:
        """Replaces the shown match by the best match if it has been better by the margin for the required
        time."""
        settings, place = self.settings, self._find_shown_rank()
        if self._browsed_at is not None and place >= 0:
            if seconds - self._browsed_at < settings.browsing:
                return
            self._browsed_at = None
        branches = ranking.columns.shape[1]
        if place >= 0 and ranking.scores[0] <= ranking.scores[place] + settings.margin * branches:
            self._beaten_since = None
            return
        if self._beaten_since is None:
            self._beaten_since = seconds
        if place < 0 or seconds - self._beaten_since >= settings.patience:
            self._shown, self._beaten_since, self._browsed_at = ranking.identity(0), None, None

    def _compute_held_fraction(self, points: Float, seconds: float, is_same_match: bool) -> float:
        """Returns the elapsed fraction of the time to hold the pose."""
        pose = points - points[0]
        size = float(np.linalg.norm(pose, axis=1).max())
        if self._anchor is None or len(self._anchor) != len(pose):
            self._anchor, self._still_since = pose, seconds
        elif np.linalg.norm(pose - self._anchor, axis=1).max() > _MAX_STILL_FRACTION * size:
            self._anchor, self._still_since, self._moved = pose, seconds, True
        elif not is_same_match or self._still_since is None:
            self._still_since = seconds
        if not self._moved or self._still_since is None:
            return 0.0
        return min((seconds - self._still_since) / self.settings.still_seconds, 1.0)
