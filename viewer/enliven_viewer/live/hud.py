"""The head-up display: state of the connection, frame rate, problems, and the live timeline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from enliven.health import HealthState, Severity
from enliven_viewer.language import later, tr
from enliven_viewer.live.match_cards import MatchCard, draw_cards
from enliven_viewer.playback.document import EdgeState
from enliven_viewer.theme import ACCENT, BAD, GLASS, GOOD, INK, QUIET, TRACK, WAIT, Colour

if TYPE_CHECKING:
    from enliven_viewer.render.overlay.canvas import Pen

SEVERITY_COLOURS = {Severity.NOTE: QUIET, Severity.WARNING: WAIT, Severity.ERROR: BAD}
"""The colour of a health message by its severity."""
_NOTICEABLE_DELAY_MS = 150.0
"""Delay in milliseconds above which people notice that the image is late. Below it, the image feels like a
mirror.
"""
_DISTURBING_DELAY_MS = 350.0
"""Delay in milliseconds above which performers overshoot, because they wait for the image."""
_MIN_SMOOTH_FPS = 20.0
"""Frame rate in frames per second below which movement looks jerky and a hint is shown."""
_NOTICE_TOP_PX = 84.0
"""Distance in pixels from the top of the image to a notice, if characters are visible. It is below the active
tool's hint.
"""
SIGNAL_COLOURS: dict[str, Colour] = {
    later("live"): GOOD,
    later("ended"): QUIET,
    later("no edge"): BAD,
    later("silent"): BAD,
}
"""The colour of the dot next to the timeline for each state of the stream. Other states use the
colour WAIT.
"""


@dataclass(frozen=True)
class HudState:
    """The contents of the head-up display.

    Attributes:
        edge: state of the connection; None during playback of a take.
        title: the take's name, or the edge's address.
        fps: frames per second.
        fraction: position on the timeline, 0..1.
        shown_s, length_s: displayed time since the timeline's start, and the timeline's length, in seconds.
        live, paused, speed: state of the playhead.
        notice: one line over the image, or empty.
        among: True if characters are in the image. Then the notice is small and at the top, to keep them
            visible.
        near: True if this window started the edge on this machine.
        possession: description of the next possession, or empty.
        score: text about the score of loose objects, or empty.
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
    cards: tuple[MatchCard, ...] = ()


def timeline_area(size: tuple[int, int], scale: float) -> tuple[float, float, float, float]:
    """Returns x, y, width and height of the timeline's track in pixels."""
    left, right = 96 * scale, 150 * scale
    return left, size[1] - 34 * scale, max(size[0] - left - right, 1.0), 6 * scale


def timeline_fraction(x: float, y: float, size: tuple[int, int], scale: float) -> float | None:
    """Returns the position of a pixel on the timeline, 0..1. None if the pixel is not near the track."""
    left, top, width, height = timeline_area(size, scale)
    reach = 14 * scale
    if not (left - reach <= x <= left + width + reach and top - reach <= y <= top + height + reach):
        return None
    return min(max((x - left) / width, 0.0), 1.0)


class Hud:
    """A head-up display, which draws a :class:`HudState` with a pen.

    Args:
        scale: pixels per pixel of a standard screen, 2 on many laptops.
    """

    def __init__(self, canvas: Pen, scale: float = 1.0) -> None:
        self._canvas, self.scale = canvas, scale
        self._small, self._normal, self._large = (round(s * scale) for s in (16, 18, 30))

    def draw(self, size: tuple[int, int], state: HudState) -> None:
        """Draws everything into an area with a width and height in pixels."""
        panel_bottom = self._draw_state_panel(state)
        if state.edge is not None and state.edge.connected and state.edge.health:
            self._draw_health_panel(size, panel_bottom, state.edge.health)
        if state.length_s > 0:
            self._draw_timeline(size, state)
        self.draw_choice(size, state.cards, state.notice, state.among)

    def draw_choice(
        self, size: tuple[int, int], cards: tuple[MatchCard, ...], notice: str, among: bool = False
    ) -> None:
        """Draws the match candidates, and one notice. ``among`` is defined in :class:`HudState`."""
        if cards:
            draw_cards(self._canvas, size, self.scale, self._small, cards)
        if notice:
            self._draw_notice(size, notice, among)

    def _draw_state_panel(self, state: HudState) -> float:
        """Draws link, phase, frame rate and latency at the top left.

        Returns the y coordinate of its lower end in pixels.
        """
        s, canvas, lines = self.scale, self._canvas, "\n".join(list_state_lines(state))
        max_width, text_height = canvas.extent(lines, self._small)
        height = 48 * s + text_height
        canvas.rectangle(16 * s, 16 * s, max(292 * s, 60 * s + max_width), height, GLASS, 10 * s)
        is_connected = state.edge is None or state.edge.connected
        canvas.disc(33 * s, 36 * s, 5 * s, GOOD if is_connected else WAIT)
        canvas.text(46 * s, 26 * s, _make_headline(state), self._normal, INK)
        canvas.text(46 * s, 50 * s, lines, self._small, QUIET)
        return 16 * s + height

    def _draw_health_panel(self, size: tuple[int, int], top: float, states: tuple[HealthState, ...]) -> None:
        """Draws problems and advice below the state, most severe first. If the space is too small, shows the
        number of hidden problems.
        """
        s, canvas, gap = self.scale, self._canvas, 8 * self.scale
        width = min(430 * s, size[0] - 32 * s)
        bottom, y, wrap = size[1] - 62 * s, top + gap, width - 42 * s
        for shown_count, state in enumerate(states):
            texts = ((state.what, INK), (state.remedy, QUIET))
            height = 18 * s + sum(canvas.extent(text, self._small, wrap)[1] for text, _ in texts)
            if y + height > bottom:
                if y + self._small < bottom:
                    canvas.text(30 * s, y, tr("and {0} more", len(states) - shown_count), self._small, QUIET)
                return
            canvas.rectangle(16 * s, y, width, height, GLASS, 10 * s)
            canvas.rectangle(
                16 * s, y + 8 * s, 4 * s, height - 16 * s, SEVERITY_COLOURS[state.severity], 2 * s
            )
            line = y + 8 * s
            for text, tint in texts:
                line += canvas.text(32 * s, line, text, self._small, tint, wrap=wrap)
            y += height + gap

    def _draw_timeline(self, size: tuple[int, int], state: HudState) -> None:
        """Draws time, track and mode along the bottom."""
        s, canvas = self.scale, self._canvas
        x, y, width, height = timeline_area(size, s)
        canvas.rectangle(16 * s, size[1] - 54 * s, size[0] - 32 * s, 42 * s, GLASS, 10 * s)
        canvas.rectangle(x, y, width, height, TRACK, height / 2)
        canvas.rectangle(x, y, width * state.fraction, height, ACCENT, height / 2)
        canvas.disc(x + width * state.fraction, y + height / 2, 8 * s, INK)
        top = y + (height - self._small) / 2
        canvas.text(x - 18 * s, top, format_time(state.shown_s), self._small, INK, align=1.0)
        if state.live:
            signal_label = _signal_label(state.edge)
            canvas.disc(x + width + 22 * s, y + height / 2, 4 * s, SIGNAL_COLOURS.get(signal_label, WAIT))
            canvas.text(x + width + 32 * s, top, tr(signal_label), self._small, INK)
        else:
            mode = "paused" if state.paused else f"{state.speed:g}x"
            canvas.text(x + width + 20 * s, top, f"{mode} · {format_time(state.length_s)}", self._small, INK)

    def _draw_notice(self, size: tuple[int, int], notice: str, is_over_characters: bool) -> None:
        """Draws one line: small at the top if it is over characters, otherwise large in the middle."""
        s, canvas = self.scale, self._canvas
        text_size, padding = (self._normal, 12 * s) if is_over_characters else (self._large, 20 * s)
        width, height = canvas.extent(notice, text_size)
        while width + 3 * padding > size[0] and text_size > self._small:
            text_size -= 1
            width, height = canvas.extent(notice, text_size)
        top = _NOTICE_TOP_PX * s if is_over_characters else size[1] * 0.42
        left = (size[0] - width) / 2 - 1.5 * padding
        canvas.rectangle(left, top - padding, width + 3 * padding, height + 2 * padding, GLASS, 14 * s)
        canvas.text(size[0] / 2, top, notice, text_size, INK, align=0.5)


def _make_headline(state: HudState) -> str:
    if state.edge is None:
        return state.title
    phase = f" · {state.edge.phase}" if state.edge.phase else ""
    place_text = (
        tr("on this machine") if state.near else tr("at {0}", state.edge.address.removeprefix("tcp://"))
    )
    return (
        tr("Stage {0}{1}", place_text, phase) if state.edge.connected else tr("No stage {0} yet", place_text)
    )


def _signal_label(edge: EdgeState | None) -> str:
    """Returns one word about the state of the stream, shown next to the timeline."""
    if edge is None or edge.phase == "ended":
        return "live" if edge is None else "ended"
    return edge.signal if edge.connected else "no edge"


def describe_delay(late_ms: float | None) -> str:
    """Returns a text about the delay of the image. Empty if the delay is too short to notice."""
    if late_ms is None or late_ms < _NOTICEABLE_DELAY_MS:
        return ""
    return tr("a little delayed") if late_ms < _DISTURBING_DELAY_MS else tr("delayed: move slowly")


def list_state_lines(state: HudState) -> list[str]:
    """Returns hints about latency and frame rate, one line each."""
    lines, edge = list[str](), state.edge
    if edge is not None and edge.connected and edge.sensor_to_pose_ms is not None:
        delay_ms = edge.sensor_to_pose_ms + (edge.pose_to_screen_ms or 0.0)
        lines += [delay_text] if (delay_text := describe_delay(delay_ms)) else []
    if 0.5 < state.fps < _MIN_SMOOTH_FPS:
        lines.append(tr("the picture is not smooth: make the window smaller"))
    if edge is not None and edge.connected and state.possession:
        lines.append(state.possession)
    if state.score:
        lines.append(state.score[:58])
    if edge is not None and edge.message:
        lines.append(edge.message[:58])
    return lines


def format_time(seconds: float) -> str:
    """Returns seconds as m:ss.t."""
    tenths = max(round(seconds * 10), 0)
    return f"{tenths // 600}:{tenths // 10 % 60:02d}.{tenths % 10}"
