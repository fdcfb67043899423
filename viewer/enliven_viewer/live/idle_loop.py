"""The idle loop: replays the last performance while the edge is lost, so that the image keeps moving."""

from __future__ import annotations

from typing import Literal

from enliven_viewer.language import later
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.render.camera import OrbitCamera

_START_DELAY_S = 1.5
"""Seconds without data from the edge before the loop begins. Shorter network interruptions do
not start it.
"""
_REPLAY_LENGTH_S = 30.0
"""Length in seconds of the replayed performance. It is long, so that the repetition is not obvious."""
_ORBIT_SPEED = 0.05
"""Speed of the idle camera orbit in radians per second: one revolution in two minutes."""

LossReason = Literal["", "away", "silent", "ended", "waiting"]
"""Reason why no new data arrives. "": new data arrives. "away": the edge is lost. "silent": its camera sends
nothing. "ended": its recording has ended. "waiting": it has not started yet.
"""
LOSS_TEXTS: dict[LossReason, str] = {
    "": "",
    "away": later("The connection to the stage is lost. The program reconnects by itself."),
    "silent": later("The camera of the stage sends no pictures."),
    "ended": later("The performance is over."),
    "waiting": later("The stage is not connected yet."),
}
"""The text for the audience while the idle loop plays."""


def find_loss_reason(live: LiveStage) -> LossReason:
    """Returns the reason why no new data arrives from a stage. Returns "" if data arrives, and for takes."""
    edge, has_moments = live.document.edge, len(live.document.timeline) > 0
    if live.take:
        return ""
    if not edge.connected:
        return "away" if has_moments else "waiting"
    if edge.phase == "ended":
        return "ended"
    return "silent" if edge.signal == "silent" and has_moments else ""


class IdleLoop:
    """The replay of the last performance while the edge is lost.

    The loop returns to live mode once the edge is back.

    Attributes:
        loss: reason why no data has arrived for :data:`_START_DELAY_S` seconds; "" while the stage is live.
    """

    def __init__(self) -> None:
        self.loss: LossReason = ""
        self._lost_s, self._replays = 0.0, False

    @property
    def audience_text(self) -> str:
        """Returns the text for the audience, or an empty text while the stage is live."""
        return LOSS_TEXTS[self.loss]

    def advance(self, live: LiveStage | None, camera: OrbitCamera, seconds: float, *, orbits: bool) -> None:
        """Advances time: starts or ends the loop, and rotates the camera.

        Args:
            orbits: whether the camera orbits; off if the user prefers less motion.
        """
        loss = find_loss_reason(live) if live is not None else ""
        self._lost_s = self._lost_s + seconds if loss else 0.0
        self.loss = loss if self._lost_s >= _START_DELAY_S else ""
        if live is None:
            return
        if self.loss and orbits:
            camera.orbit(_ORBIT_SPEED * seconds, 0.0)
        if self.loss and live.playhead.live and len(live.document.timeline) > 1:
            live.playhead.replay_last(_REPLAY_LENGTH_S)
            self._replays = True
        elif not self.loss and self._replays:
            live.playhead.go_live()
            self._replays = False
