"""The idle loop: what was performed last, over and over, while the edge is lost: no picture freezes."""

from __future__ import annotations

from typing import Literal

from enliven_viewer.language import later
from enliven_viewer.live.stage import LiveStage
from enliven_viewer.render import OrbitCamera

_PATIENCE_S = 1.5
"""Seconds without the edge before the loop begins: a short gap of the network is not worth a cut."""
_REPLAYED_S = 30.0
"""Seconds of the performance that the loop shows: long enough not to look like a loop."""
_ORBIT = 0.05
"""Radians a second of the idle camera orbit: once in two minutes, slow enough to be calm."""

Loss = Literal["", "away", "silent", "ended", "waiting"]
"""Why nothing comes: not, the edge is lost, its camera is silent, its recording is over, it never came."""
WORDS: dict[Loss, str] = {
    "": "",
    "away": later("The stage is away. It comes back by itself."),
    "silent": later("The camera of the stage is silent."),
    "ended": later("The performance is over."),
    "waiting": later("The stage is not here yet."),
}
"""The sentence for the audience while the idle loop plays."""


def loss_of(live: LiveStage) -> Loss:
    """Returns why nothing new comes from a stage; "" if it does, and for takes."""
    edge, known = live.document.edge, len(live.document.timeline) > 0
    if live.take:
        return ""
    if not edge.connected:
        return "away" if known else "waiting"
    if edge.phase == "ended":
        return "ended"
    return "silent" if edge.signal == "silent" and known else ""


class IdleLoop:
    """Plays back what was performed last while the edge is lost, and follows the edge again once it is back.

    Attributes:
        loss: why nothing comes, once that has lasted; "" while the stage is live.
    """

    def __init__(self) -> None:
        self.loss: Loss = ""
        self._lost_s, self._replays = 0.0, False

    @property
    def words(self) -> str:
        """Returns the sentence for the audience; empty while the stage is live."""
        return WORDS[self.loss]

    def advance(self, live: LiveStage | None, camera: OrbitCamera, seconds: float, *, orbits: bool) -> None:
        """Lets time pass: begin or end the loop, and turn the camera.

        Args:
            orbits: whether the camera goes round; not for those who want less motion.
        """
        loss = loss_of(live) if live is not None else ""
        self._lost_s = self._lost_s + seconds if loss else 0.0
        self.loss = loss if self._lost_s >= _PATIENCE_S else ""
        if live is None:
            return
        if self.loss and orbits:
            camera.orbit(_ORBIT * seconds, 0.0)
        if self.loss and live.playhead.live and len(live.document.timeline) > 1:
            live.playhead.replay_last(_REPLAYED_S)
            self._replays = True
        elif not self.loss and self._replays:
            live.playhead.go_live()
            self._replays = False
