"""Draws text about the live stage over the view, for artists and for an audience."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.live.hud import Hud, HudState, format_time, timeline_fraction
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.live.match_cards import make_cards
from enliven_viewer.playback.timeline import NS_PER_S
from enliven_viewer.render.overlay.canvas import Pen
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.panel_layout import HOLDER_LINE_HEIGHT, Area
from enliven_viewer.studio.app.style import pack_colour
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.theme import BAD, GLASS, GOOD, INK, SHADOW, WAIT, Colour, get_performer_colour

PERFORMER_TEXT_SIZE_PX = 26.0
"""Text size in pixels of the lines about performers. It is readable from three metres."""
_CHARACTER_SIZE_TEXT_SIZE = 64.0
"""Text size in pixels of a character's size. The performer who scales the character reads it from across the
room.
"""
_GESTURE_TEXT_SIZE = 20.0
"""Text size in pixels of the gesture hint. It is readable from two metres."""
_TEXT_MARGIN = 18.0
"""Distance in pixels of the size and the gesture hint from the left and the top of the view."""
_COUNT_IN_TEXT_SIZE = 150.0
"""Text size in pixels of the count-in. It is visible from across the room."""
_PLAY_BOTTOM_MARGIN = 64.0
"""Distance in pixels from the bottom of the view to the lines in the Play workspace. They are above the live
timeline.
"""
_BOTTOM_MARGIN = 14.0
"""Distance in pixels from the bottom of the view to the lines in other workspaces."""
_UTTERANCE_BOTTOM = 96.0
"""Distance in pixels from the top of the view to the bottom of the recognised words. They are below the
recording time.
"""
LINE_PADDING_PX = 14.0
"""Total height in pixels of the margins above and below a line of large text."""
_GAP = 8.0
"""Gap in pixels between the text of an overlay and the recognised words."""
_MIN_LINE_WIDTH = 240.0
"""Minimum width in pixels of the lines next to the inset. If there is less space, the lines
cover the inset.
"""


def draw_live(app: App, area: Area, frame_rate: float) -> None:
    """Draws the live information over the viewport. ``frame_rate`` is in frames per second."""
    perform = app.state(PerformSession)
    live = perform.live
    app.widgets.pop("holders", None)
    if live is None:
        return
    draw_list = imgui.get_background_draw_list()
    size = (round(area.width), round(area.height))
    draw_list.push_clip_rect(ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height))
    hud = Hud(Pen(draw_list, (area.x, area.y)))
    view = app.editor.lens.view
    is_over_characters = bool(app.editor.visible_characters)
    if perform.active_workspace == "Play":
        hud.draw(
            size, _make_hud_state(live, frame_rate, live.describe_next_possession(view), is_over_characters)
        )
        _handle_scrubbing(live, area, size)
    else:
        notice = live.empty_image_text if not live.scene.actors else ""
        hud.draw_choice(size, make_cards(live.scene, view), notice, is_over_characters)
    if perform.active_workspace in ("Perform", "Play"):
        free_area = find_area_next_to_preview(area, app.widgets.get("performer inset"))
        height = draw_holders(perform, draw_list, free_area)
        if height:
            bottom = area.y + area.height
            app.widgets["holders"] = (
                free_area.x,
                bottom - height,
                free_area.x + free_area.width,
                bottom,
            )
        draw_size(perform, draw_list, area)
        text_bottom = max((overlay.find_bottom() for overlay in app.overlays), default=0.0)
        draw_utterance(perform, draw_list, area, find_utterance_bottom(text_bottom))
    _draw_recording(perform, draw_list, area)
    draw_list.pop_clip_rect()


def _make_hud_state(live: LiveStage, frame_rate: float, notice: str, is_over_characters: bool) -> HudState:
    timeline, head = live.document.timeline, live.playhead
    return HudState(
        edge=None if live.take else replace(live.document.edge),
        title=live.take,
        fps=frame_rate,
        fraction=head.fraction,
        shown_s=(head.time_ns - timeline.start_ns) / NS_PER_S,
        length_s=(timeline.end_ns - timeline.start_ns) / NS_PER_S,
        live=head.live,
        paused=head.paused,
        speed=head.speed,
        notice=live.empty_image_text,
        among=is_over_characters,
        near=live.is_local,
        possession=notice,
        score=live.scene.props.note if live.scene.props is not None else "",
    )


def _handle_scrubbing(live: LiveStage, area: Area, size: tuple[int, int]) -> None:
    """Lets the pointer scrub the playhead along the live timeline."""
    io = imgui.get_io()
    x, y = io.mouse_pos.x - area.x, io.mouse_pos.y - area.y
    pressed_fraction = timeline_fraction(x, y, size, 1.0)
    if pressed_fraction is not None and not io.want_capture_mouse and imgui.is_mouse_clicked(0):
        live.scrubbing = True
    live.scrubbing = live.scrubbing and imgui.is_mouse_down(0)
    if live.scrubbing:
        track_fraction = timeline_fraction(x, size[1] - 34, size, 1.0)
        live.playhead.scrub(track_fraction if track_fraction is not None else float(x > size[0] / 2))


def find_area_next_to_preview(area: Area, inset: tuple[float, float, float, float] | None) -> Area:
    """Returns the part of the view next to an inset at the bottom."""
    if inset is None or inset[3] < area.y + area.height / 2:
        return area
    left, _, right, _ = inset
    if left - area.x > area.x + area.width - right:
        free = Area(area.x, area.y, left - area.x, area.height)
    else:
        free = Area(right, area.y, area.x + area.width - right, area.height)
    return free if free.width > _MIN_LINE_WIDTH else area


def draw_holders(perform: PerformSession, draw_list: imgui.ImDrawList, area: Area) -> float:
    """Draws the condition for which Possess waits, and a line for each controlled character with its
    performers.

    Returns:
        Distance in pixels from the bottom of the viewport to the top of the highest line; 0 without lines.
    """
    begin = bottom = (
        area.y + area.height - (_PLAY_BOTTOM_MARGIN if perform.active_workspace == "Play" else _BOTTOM_MARGIN)
    )
    if perform.possession_requests.words:
        _draw_line(draw_list, area, bottom, perform.possession_requests.words, WAIT)
        bottom -= HOLDER_LINE_HEIGHT
    for holder in reversed(perform.holders):
        present = perform.performers
        number = present.index(holder.body) if holder.body in present else 0
        tint = get_performer_colour(number)
        _draw_line(draw_list, area, bottom, holder.description, tint)
        bottom -= HOLDER_LINE_HEIGHT
    return 0.0 if bottom == begin else area.y + area.height - bottom


def find_utterance_bottom(text_bottom: float) -> float:
    """Returns the lower end of the recognised words in pixels from the top.

    It is below the overlay's text, which ends ``text_bottom`` pixels from the top; 0 without text.
    """
    below_text = text_bottom + _GAP + PERFORMER_TEXT_SIZE_PX + LINE_PADDING_PX
    return max(below_text, _UTTERANCE_BOTTOM) if text_bottom else _UTTERANCE_BOTTOM


def draw_utterance(
    perform: PerformSession, draw_list: imgui.ImDrawList, area: Area, below: float = _UTTERANCE_BOTTOM
) -> None:
    """Draws the recognised words in large text at the top, without moving other text."""
    words = perform.voice.heard_words
    if words:
        _draw_line(draw_list, area, area.y + below, words, GOOD if perform.voice.is_understood else WAIT)


def _draw_line(draw_list: imgui.ImDrawList, area: Area, bottom: float, text: str, tint: Colour) -> None:
    """Draws one centred line of large text above ``bottom``."""
    max_width = area.width - 90.0
    size = min(
        PERFORMER_TEXT_SIZE_PX,
        PERFORMER_TEXT_SIZE_PX * max_width / max(_measure_width(text, PERFORMER_TEXT_SIZE_PX), 1.0),
    )
    width = _measure_width(text, size)
    left, top = area.x + (area.width - width) / 2, bottom - size - LINE_PADDING_PX
    low, high = ImVec2(left - 44, top), ImVec2(left + width + 20, bottom)
    draw_list.add_rect_filled(low, high, pack_colour((*GLASS[:3], 0.85)), 12.0)
    draw_list.add_circle_filled(ImVec2(left - 22, top + 7 + size / 2), 8.0, pack_colour(tint))
    draw_list.add_text(imgui.get_font(), size, ImVec2(left, top + 7), pack_colour(INK), text)


def _draw_recording(perform: PerformSession, draw_list: imgui.ImDrawList, area: Area) -> None:
    """Draws the count-in in the middle, or the recorded time at the top."""
    if perform.recording.beat:
        text = str(perform.recording.beat)
        x = area.x + (area.width - _measure_width(text, _COUNT_IN_TEXT_SIZE)) / 2
        y = area.y + area.height * 0.4 - _COUNT_IN_TEXT_SIZE / 2
        draw_list.add_text(
            imgui.get_font(), _COUNT_IN_TEXT_SIZE, ImVec2(x + 3, y + 3), pack_colour(SHADOW, 0.5), text
        )
        draw_list.add_text(imgui.get_font(), _COUNT_IN_TEXT_SIZE, ImVec2(x, y), pack_colour(INK), text)
    elif perform.recording.phase == "recording":
        text = tr("Recording   {0}", format_time(perform.recording.seconds))
        width = _measure_width(text, 20.0)
        x, y = area.x + (area.width - width) / 2, area.y + 18
        draw_list.add_rect_filled(
            ImVec2(x - 40, y - 8), ImVec2(x + width + 18, y + 29), pack_colour((*GLASS[:3], 0.85)), 10.0
        )
        draw_list.add_circle_filled(ImVec2(x - 20, y + 11), 7.0, pack_colour(BAD))
        draw_list.add_text(imgui.get_font(), 20.0, ImVec2(x, y), pack_colour(INK), text)


def draw_size(perform: PerformSession, draw_list: imgui.ImDrawList, area: Area) -> None:
    """Draws the size of a character that hands are scaling, and the gesture hint, at the left."""
    if perform.sizes.text is None:
        return
    left, top = area.x + _TEXT_MARGIN, area.y + _TEXT_MARGIN
    for text, high in zip(perform.sizes.text, (_CHARACTER_SIZE_TEXT_SIZE, _GESTURE_TEXT_SIZE), strict=True):
        size = min(high, high * (area.width - 4 * _TEXT_MARGIN) / max(_measure_width(text, high), 1.0))
        low, far = ImVec2(left, top), ImVec2(left + _measure_width(text, size) + 36, top + size + 14)
        draw_list.add_rect_filled(low, far, pack_colour((*GLASS[:3], 0.85)), 12.0)
        draw_list.add_text(imgui.get_font(), size, ImVec2(left + 18, top + 7), pack_colour(INK), text)
        top += size + 20


def _measure_width(text: str, size: float) -> float:
    return imgui.calc_text_size(text).x * size / imgui.get_font_size()


_NOTICE_TEXT_SIZE = 26.0
"""Text size in pixels of the notice. It is readable from the back of a room."""
_NOTICE_MARGIN = 72.0
"""Distance in pixels between the notice and the bottom of the view."""


def draw_audience(app: App, area: Area, notice: str) -> None:
    """Draws over the whole view. ``notice`` is the text about a lost stage, or an empty result while the
    stage is live.
    """
    live = app.state(PerformSession).live
    draw_list = imgui.get_background_draw_list()
    if not app.asking:
        imgui.set_mouse_cursor(imgui.MouseCursor_.none)
    if notice:
        _draw_sentence(draw_list, area, tr(notice))
    elif live is not None:
        cards = make_cards(live.scene, app.editor.lens.view)
        Hud(Pen(draw_list, (area.x, area.y))).draw_choice((round(area.width), round(area.height)), cards, "")
        draw_holders(app.state(PerformSession), draw_list, area)
        draw_size(app.state(PerformSession), draw_list, area)


def _draw_sentence(draw_list: imgui.ImDrawList, area: Area, text: str) -> None:
    """Draws one sentence centred at the bottom."""
    width = imgui.calc_text_size(text).x / imgui.get_font_size()
    size = min(_NOTICE_TEXT_SIZE, (area.width - 80.0) / max(width, 1.0))
    left, top = area.x + (area.width - width * size) / 2, area.y + area.height - _NOTICE_MARGIN
    low, high = ImVec2(left - 26, top - 12), ImVec2(left + width * size + 26, top + size + 12)
    draw_list.add_rect_filled(low, high, pack_colour((*GLASS[:3], 0.85)), 14.0)
    draw_list.add_text(imgui.get_font(), size, ImVec2(left, top), pack_colour(INK), text)
