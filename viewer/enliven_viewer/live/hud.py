"""The head-up display: state of the link, frame rate, problems, and the live timeline."""

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
_NOTICEABLE_DELAY_MS = 150.0
"""Delay in milliseconds above which people notice that the image follows them. Below it, it feels like a
mirror.
"""
_DISTURBING_DELAY_MS = 350.0
"""Delay in milliseconds above which people overshoot, since they wait for the image."""
_MIN_SMOOTH_FPS = 20.0
"""Frame rate below which movement looks jerky, in frames per second. Below it, a hint is shown."""
_NOTICE_TOP = 84.0
"""Distance in pixels from the top of a notice over characters: below the active tool's hint."""
SIGNAL: dict[str, Colour] = {
    later("live"): GOOD,
    later("ended"): QUIET,
    later("no edge"): BAD,
    later("silent"): BAD,
}
"""The colour of the dot next to the timeline by the state of the stream; other states have the colour of
waiting.
"""


@dataclass(frozen=True)
class HudState:
    """The contents of the head-up display.

    Attributes:
        edge: state of the link; None during playback of a take.
        title: the take's name, or the edge's address.
        fps: frames per second.
        fraction: position on the timeline, 0..1.
        shown_s, length_s: seconds since the timeline's start, and the timeline's length.
        live, paused, speed: state of the playhead.
        notice: one line over the image, or empty.
        among: whether characters are visible, which the notice must not cover.
        near: whether the edge runs on this machine and was started for this window.
        possession: description of the next possession, or empty.
        score: text about loose objects, or empty.
        cards: the match candidates of a pose.
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
    """Returns x, y, width and height of the timeline's track in pixels."""
    left, right = 96 * scale, 150 * scale
    return left, size[1] - 34 * scale, max(size[0] - left - right, 1.0), 6 * scale


def timeline_fraction(x: float, y: float, size: tuple[int, int], scale: float) -> float | None:
    """Returns the position of a pixel on the timeline, 0..1; None if it is not near the track."""
    left, top, width, height = timeline_area(size, scale)
    reach = 14 * scale
    if not (left - reach <= x <= left + width + reach and top - reach <= y <= top + height + reach):
        return None
    return min(max((x - left) / width, 0.0), 1.0)


class Hud:
    """A head-up display, which draws a :class:`HudState` with a pen.

    Args:
        scale: pixels per pixel of a standard screen (2 on many laptops).
    """

    def __init__(self, canvas: Pen, scale: float = 1.0) -> None:
        self._canvas, self.scale = canvas, scale
        self._small, self._normal, self._large = (round(s * scale) for s in (16, 18, 30))

    def draw(self, size: tuple[int, int], state: HudState) -> None:
        """Draws everything into an area with a width and height in pixels."""
        below = self._state_panel(state)
        if state.edge is not None and state.edge.connected and state.edge.health:
            self._health_panel(size, below, state.edge.health)
        if state.length_s > 0:
            self._timeline(size, state)
        self.draw_choice(size, state.cards, state.notice, state.among)

    def draw_choice(
        self, size: tuple[int, int], cards: tuple[Card, ...], notice: str, among: bool = False
    ) -> None:
        """Draws the match candidates, and one notice, above characters if some are visible."""
        if cards:
            draw_cards(self._canvas, size, self.scale, self._small, cards)
        if notice:
            self._notice(size, notice, among)

    def _state_panel(self, state: HudState) -> float:
        """Draws link, phase, frame rate and latency at the top left.

        Returns the y coordinate of its lower end in pixels.
        """
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
        """Draws problems and advice below the state, most severe first.

        If space runs out, shows how many are left.
        """
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
        """Draws time, track and mode along the bottom."""
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
        """Draws one line: large in the middle of an empty image, or small at the top of others."""
        s, canvas = self.scale, self._canvas
        letters, around = (self._normal, 12 * s) if among else (self._large, 20 * s)
        wide, high = canvas.extent(notice, letters)
        while wide + 3 * around > size[0] and letters > self._small:
            letters -= 1
            wide, high = canvas.extent(notice, letters)
        top = _NOTICE_TOP * s if among else size[1] * 0.42
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
    """Returns one word about the state of the stream, shown next to the timeline."""
    if edge is None or edge.phase == "ended":
        return "live" if edge is None else "ended"
    return edge.signal if edge.connected else "no edge"


def late_words(late_ms: float | None) -> str:
    """Returns a text about the delay of the image; empty if it is too short to notice."""
    if late_ms is None or late_ms < _NOTICEABLE_DELAY_MS:
        return ""
    return tr("a little late") if late_ms < _DISTURBING_DELAY_MS else tr("late: move slowly")


def _state_lines(state: HudState) -> list[str]:
    """Returns hints about latency and frame rate, one line each."""
    lines, edge = list[str](), state.edge
    if edge is not None and edge.connected and edge.sensor_to_pose_ms is not None:
        late = edge.sensor_to_pose_ms + (edge.pose_to_screen_ms or 0.0)
        lines += [words] if (words := late_words(late)) else []
    if 0.5 < state.fps < _MIN_SMOOTH_FPS:
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
