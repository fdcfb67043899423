"""The head-up display: the state of the link, the pace, what is wrong, and the live timeline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from enliven.health import HealthState, Severity
from enliven_viewer.language import later, tr
from enliven_viewer.live.match_cards import Card, draw_cards
from enliven_viewer.playback import EdgeState
from enliven_viewer.theme import ACCENT, BAD, GLASS, GOOD, INK, QUIET, TRACK, WAIT, Colour

if TYPE_CHECKING:
    from enliven_viewer.render.overlay import Pen

SEVERITY = {Severity.NOTE: QUIET, Severity.WARNING: WAIT, Severity.ERROR: BAD}
"""The colour of a health message by its severity."""
_FELT_MS = 150.0
"""Delay above which people feel that the picture follows them: shorter ones feel like a mirror."""
_DISTURBING_MS = 350.0
"""Delay above which people overshoot, since they wait for the picture."""
_SMOOTH = 20.0
"""Frames per second below which movement is seen to jerk, and it is said."""
_NOTICE = 84.0
"""Pixels from the top at which a notice stands over characters: below the hint of the tool in hand."""
SIGNAL: dict[str, Colour] = {
    later("live"): GOOD,
    later("ended"): QUIET,
    later("no edge"): BAD,
    later("silent"): BAD,
}
"""The colour of the dot beside the timeline by how the frames arrive; else that of waiting."""


@dataclass(frozen=True)
class HudState:
    """The contents of the head-up display.

    Attributes:
        edge: state of the link; None when a take is played.
        title: the take's name, or the edge's address.
        fps: frames per second.
        fraction: place on the timeline, 0..1.
        shown_s, length_s: seconds since the timeline's start, and its length.
        live, paused, speed: of the playhead.
        notice: one line for the picture, or empty.
        among: whether characters are seen that the notice must not cover.
        near: whether the edge is on this machine, started for this window.
        possession: what the next possession takes, or empty.
        score: what is said of loose things, or empty.
        cards: the matches of a pose that are to choose from.
    """

    edge: EdgeState | None = None
    title: str = ""
    fps: float = 0.0
    fraction: float = 1.0
    shown_s: float = 0.0
    length_s: float = 0.0
    live: bool = True
    paused: bool = False
    speed: float = 1.0
    notice: str = ""
    among: bool = False
    near: bool = False
    possession: str = ""
    score: str = ""
    cards: tuple[Card, ...] = ()


def timeline_area(size: tuple[int, int], scale: float) -> tuple[float, float, float, float]:
    """x, y, width, height in pixels of the timeline's track."""
    left, right = 96 * scale, 150 * scale
    return left, size[1] - 34 * scale, max(size[0] - left - right, 1.0), 6 * scale


def timeline_fraction(x: float, y: float, size: tuple[int, int], scale: float) -> float | None:
    """Returns the place of a pixel on the timeline, 0..1; None if it is not near the track."""
    left, top, width, height = timeline_area(size, scale)
    reach = 14 * scale
    if not (left - reach <= x <= left + width + reach and top - reach <= y <= top + height + reach):
        return None
    return min(max((x - left) / width, 0.0), 1.0)


class Hud:
    """Draws a :class:`HudState` with a pen.

    Args:
        scale: pixels for one of a plain screen (2 on many laptops).
    """

    def __init__(self, canvas: Pen, scale: float = 1.0) -> None:
        self._canvas, self.scale = canvas, scale
        self._small, self._normal, self._large = (round(s * scale) for s in (16, 18, 30))

    def draw(self, size: tuple[int, int], state: HudState) -> None:
        """Draws everything onto an area of a width and height in pixels."""
        below = self._state_panel(state)
        if state.edge is not None and state.edge.connected and state.edge.health:
            self._health_panel(size, below, state.edge.health)
        if state.length_s > 0:
            self._timeline(size, state)
        self.draw_choice(size, state.cards, state.notice, state.among)

    def draw_choice(
        self, size: tuple[int, int], cards: tuple[Card, ...], notice: str, among: bool = False
    ) -> None:
        """Draws the matches that are to choose from, and one line, above characters where some are seen."""
        if cards:
            draw_cards(self._canvas, size, self.scale, self._small, cards)
        if notice:
            self._notice(size, notice, among)

    def _state_panel(self, state: HudState) -> float:
        """Top left: link, phase, pace, latency; where it ends, pixels from the top."""
        s, canvas, lines = self.scale, self._canvas, "\n".join(_state_lines(state))
        widest, high = canvas.extent(lines, self._small)
        height = 48 * s + high
        canvas.rectangle(16 * s, 16 * s, max(292 * s, 60 * s + widest), height, GLASS, 10 * s)
        good = state.edge is None or state.edge.connected
        canvas.disc(33 * s, 36 * s, 5 * s, GOOD if good else WAIT)
        canvas.text(46 * s, 26 * s, _headline(state), self._normal, INK)
        canvas.text(46 * s, 50 * s, lines, self._small, QUIET)
        return 16 * s + height

    def _health_panel(self, size: tuple[int, int], top: float, states: tuple[HealthState, ...]) -> None:
        """Draws below the state the problems and what to do, the gravest first; count those without room."""
        s, canvas, gap = self.scale, self._canvas, 8 * self.scale
        width = min(430 * s, size[0] - 32 * s)
        bottom, y, wrap = size[1] - 62 * s, top + gap, width - 42 * s
        for shown, state in enumerate(states):
            texts = ((state.what, INK), (state.mend, QUIET))
            height = 18 * s + sum(canvas.extent(text, self._small, wrap)[1] for text, _ in texts)
            if y + height > bottom:
                if y + self._small < bottom:
                    canvas.text(30 * s, y, tr("and {0} more", len(states) - shown), self._small, QUIET)
                return
            canvas.rectangle(16 * s, y, width, height, GLASS, 10 * s)
            canvas.rectangle(16 * s, y + 8 * s, 4 * s, height - 16 * s, SEVERITY[state.severity], 2 * s)
            line = y + 8 * s
            for text, tint in texts:
                line += canvas.text(32 * s, line, text, self._small, tint, wrap=wrap)
            y += height + gap

    def _timeline(self, size: tuple[int, int], state: HudState) -> None:
        """Along the bottom: time, track, mode."""
        s, canvas = self.scale, self._canvas
        x, y, width, height = timeline_area(size, s)
        canvas.rectangle(16 * s, size[1] - 54 * s, size[0] - 32 * s, 42 * s, GLASS, 10 * s)
        canvas.rectangle(x, y, width, height, TRACK, height / 2)
        canvas.rectangle(x, y, width * state.fraction, height, ACCENT, height / 2)
        canvas.disc(x + width * state.fraction, y + height / 2, 8 * s, INK)
        top = y + (height - self._small) / 2
        canvas.text(x - 18 * s, top, time_text(state.shown_s), self._small, INK, align=1.0)
        if state.live:
            word = _signal_word(state.edge)
            canvas.disc(x + width + 22 * s, y + height / 2, 4 * s, SIGNAL.get(word, WAIT))
            canvas.text(x + width + 32 * s, top, tr(word), self._small, INK)
        else:
            mode = "paused" if state.paused else f"{state.speed:g}x"
            canvas.text(x + width + 20 * s, top, f"{mode} · {time_text(state.length_s)}", self._small, INK)

    def _notice(self, size: tuple[int, int], notice: str, among: bool) -> None:
        """One line, large in the middle of an empty picture, small at the top of another one."""
        s, canvas = self.scale, self._canvas
        letters, around = (self._normal, 12 * s) if among else (self._large, 20 * s)
        wide, high = canvas.extent(notice, letters)
        while wide + 3 * around > size[0] and letters > self._small:
            letters -= 1
            wide, high = canvas.extent(notice, letters)
        top = _NOTICE * s if among else size[1] * 0.42
        left = (size[0] - wide) / 2 - 1.5 * around
        canvas.rectangle(left, top - around, wide + 3 * around, high + 2 * around, GLASS, 14 * s)
        canvas.text(size[0] / 2, top, notice, letters, INK, align=0.5)


def _headline(state: HudState) -> str:
    if state.edge is None:
        return state.title
    phase = f" · {state.edge.phase}" if state.edge.phase else ""
    where = tr("on this machine") if state.near else tr("at {0}", state.edge.address.removeprefix("tcp://"))
    return tr("Stage {0}{1}", where, phase) if state.edge.connected else tr("No stage {0} yet", where)


def _signal_word(edge: EdgeState | None) -> str:
    """Returns how the frames arrive, in a word beside the timeline."""
    if edge is None or edge.phase == "ended":
        return "live" if edge is None else "ended"
    return edge.signal if edge.connected else "no edge"


def late_words(late_ms: float | None) -> str:
    """Returns how far the picture is behind the performer; empty if it is too little to feel."""
    if late_ms is None or late_ms < _FELT_MS:
        return ""
    return tr("a little late") if late_ms < _DISTURBING_MS else tr("late: move slowly")


def _state_lines(state: HudState) -> list[str]:
    """Pace and latency, one line each."""
    lines, edge = list[str](), state.edge
    if edge is not None and edge.connected and edge.sensor_to_pose_ms is not None:
        late = edge.sensor_to_pose_ms + (edge.pose_to_screen_ms or 0.0)
        lines += [words] if (words := late_words(late)) else []
    if 0.5 < state.fps < _SMOOTH:
        lines.append(tr("the picture is not smooth: a smaller window is drawn faster"))
    if edge is not None and edge.connected and state.possession:
        lines.append(state.possession)
    if state.score:
        lines.append(state.score[:58])
    if edge is not None and edge.message:
        lines.append(edge.message[:58])
    return lines


def time_text(seconds: float) -> str:
    """Returns seconds as m:ss.t."""
    tenths = max(round(seconds * 10), 0)
    return f"{tenths // 600}:{tenths // 10 % 60:02d}.{tenths % 10}"
