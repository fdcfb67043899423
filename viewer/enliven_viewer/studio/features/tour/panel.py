"""Draws the tour: a card with one sentence, an outline around its target, an arrow, and the animated hand."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.panel_layout import MENU_HEIGHT, Area, PanelLayout
from enliven_viewer.studio.app.style import pack_colour, push_fill
from enliven_viewer.studio.features.tour.card_placement import Rectangle, place_arrow, place_card
from enliven_viewer.studio.features.tour.tour import Tour
from enliven_viewer.studio.features.tour.tour_steps import TOUR_STEPS
from enliven_viewer.theme import ACCENT, DARK, GOOD, INK, QUIET

_CARD_WIDTH = 330.0
"""Width of the card in pixels. It fits a sentence in two lines, and four buttons."""
_SENTENCE_TEXT_SIZE = 19.0
"""Text size of the sentence in pixels. It is readable for children, and for people who stand."""
_ICON_SIZE = 26.0
"""Size in pixels of a step's icon: the same as on the target's button, but larger."""
_BUTTON_HEIGHT = 30.0
"""Height of the buttons in pixels. They are easy to hit."""
_DOT_RADIUS = 4.0
"""Radius in pixels of a step's dot."""
_OUTLINE_GAP = 5.0
"""Gap in pixels between the target and its outline."""
_OUTLINE_WIDTH = 3.0
"""Width of the outline in pixels."""
_PULSE_S = 1.4
"""Period in seconds of the pulsing outline. It is slow, but noticeable in peripheral vision."""
_ARROW_HEAD_SIZE = 11.0
"""Size in pixels of an arrow's head."""
_DASH_LENGTH = 9.0
"""Length in pixels of a dash of the drag path, and of the gap after it."""
_HAND_SIZE = 30.0
"""Size of the hand in pixels."""
_TOUR_WIDGETS = ("tour card", "tour outline")
"""Names of the tour's own widgets."""
_TOOLTIP_EXTENT = (380.0, 58.0)
"""Extent in pixels of a widget's tooltip: to each side of the widget's centre, and below it."""
_WINDOW_FLAGS = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_scrollbar
    | imgui.WindowFlags_.no_focus_on_appearing
)
_DONE_TEXT = later("Done!")
_REVIEWED_TEXT = later("You did this already.")
_SHOW_LABEL, _BACK_LABEL, _SKIP_LABEL, _NEXT_LABEL, _LATER_LABEL, _CLOSE_LABEL = (
    later("Show me"),
    later("Back"),
    later("Skip"),
    later("Next"),
    later("Later"),
    later("Close"),
)


def draw_tour(app: App, tour: Tour | None, places: PanelLayout, end: Callable[[], object]) -> None:
    """Draws the tour on top of everything; ``end`` closes it."""
    area = places.viewport
    app.drawn.picture += 1
    app.drawn.is_user_scrolling |= bool(imgui.get_io().mouse_wheel)
    app.widgets.pop("tour outline", None)
    if tour is None:
        return
    target = tour.outline((area.x, area.y))
    dialogue = bool(app.asking)
    if dialogue and not any(name.startswith(("file name", "dialog")) for name in tour.target.widgets):
        target = None  # A dialogue covers the target, so do not point at it.
    shape = _add_margin(target) if target is not None else None
    if dialogue:
        card = _draw_bubble(tour, shape)
    else:
        card = _draw_card(app, tour, places, shape, end)
    draw_list = imgui.get_foreground_draw_list()
    if shape is not None:
        app.widgets["tour outline"] = shape
        _draw_outline(draw_list, shape, calm=app.preferences.less_motion)
        if card is not None and tour.target.box is None:
            _draw_arrow(
                draw_list,
                card,
                shape,
                [app.widgets[name] for name in app.widgets if name not in _TOUR_WIDGETS],
            )
    if tour.target.path and not dialogue:
        _draw_drag_path(draw_list, [ImVec2(area.x + x, area.y + y) for x, y in tour.target.path])
    _draw_hand(app, tour)


def _add_margin(target: Rectangle) -> Rectangle:
    """Returns the outline around a rectangle, clipped to the window."""
    size = imgui.get_io().display_size
    left, top, right, bottom = target
    return (
        max(left - _OUTLINE_GAP, 0.0),
        max(top - _OUTLINE_GAP, 0.0),
        min(right + _OUTLINE_GAP, size.x),
        min(bottom + _OUTLINE_GAP, size.y),
    )


def _draw_card(
    app: App, tour: Tour, places: PanelLayout, shape: Rectangle | None, end: Callable[[], object]
) -> Rectangle:
    """Draws the card next to its target."""
    area = places.viewport
    size = imgui.get_io().display_size
    width = min(_CARD_WIDTH, size.x - 20)
    height = _find_height(tour, width)
    window = 0.0, MENU_HEIGHT if places.viewport.y else 0.0, size.x, size.y
    others = [
        (place.x, place.y, place.x + place.width, place.y + place.height)
        for place in (places.side, places.tools, places.timeline)
    ]
    widgets = app.widgets
    obstacles = (
        tour.find_chair_rectangle((area.x, area.y)),
        widgets.get("performer inset"),
        widgets.get("holders"),
    )
    others += [obstacle for obstacle in obstacles if obstacle is not None]
    if shape is not None and tour.target.box is None:
        middle = (shape[1] + shape[3]) / 2
        others += [
            (
                shape[0] - _TOOLTIP_EXTENT[0],
                middle,
                shape[2] + _TOOLTIP_EXTENT[0],
                middle + _TOOLTIP_EXTENT[1],
            )
        ]
    page = app.drawn.find(("start page",))
    others += [page[1]] if page is not None else []
    picture = area.x, area.y, area.x + area.width, area.y + area.height
    # Move the card only when its sentence changes, so that its buttons stay under the pointer.
    key = tour.number, tour.text, tour.done_display_s > 0.0, width, height, size.x, size.y, shape is None
    shown_card = tour.card if tour.card_key == key or tour.done_display_s > 0.0 else None
    target = _add_drag_path(tour, area, shape)
    x, y = place_card((width, height), window, target, others, picture, shown_card)
    tour.card, tour.card_key = (x, y), key
    imgui.set_next_window_pos(ImVec2(x, y))
    imgui.set_next_window_size(ImVec2(width, height))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.5)
    imgui.push_style_color(imgui.Col_.border, pack_colour(ACCENT, 0.7))
    imgui.begin(labelled(tr("Tour"), "Tour"), None, _WINDOW_FLAGS)
    _draw_sentence(tour)
    _draw_dots(tour)
    _draw_buttons(app, tour, end)
    imgui.end()
    imgui.pop_style_color()
    imgui.pop_style_var()
    app.widgets["tour card"] = (x, y, x + width, y + height)
    return x, y, x + width, y + height


def _add_drag_path(tour: Tour, area: Area, shape: Rectangle | None) -> Rectangle | None:
    """Returns the bounding box of the target's outline and the drag path."""
    if shape is None or not tour.target.path:
        return shape
    across = [area.x + x for x, _ in tour.target.path]
    down = [area.y + y for _, y in tour.target.path]
    return min(shape[0], *across), min(shape[1], *down), max(shape[2], *across), max(shape[3], *down)


def _get_sentence(tour: Tour) -> str:
    if tour.done_display_s > 0.0:
        return tr(_DONE_TEXT)
    return tr(tour.text or _REVIEWED_TEXT)


def _find_height(tour: Tour, width: float) -> float:
    """Returns the height of the card in pixels.

    ImGui's automatic size is one frame late, and would clip the card.
    """
    style = imgui.get_style()
    text_width = width - 2 * style.window_padding.x
    grown = _SENTENCE_TEXT_SIZE / imgui.get_font_size()
    text_height = imgui.calc_text_size(_get_sentence(tour), wrap_width=text_width / grown).y * grown
    inner = _ICON_SIZE + text_height + 2 * _DOT_RADIUS + 4 + _BUTTON_HEIGHT
    return float(2 * style.window_padding.y + inner + 3 * style.item_spacing.y)


def _draw_sentence(tour: Tour) -> None:
    is_done = tour.done_display_s > 0.0 or tour.step is None
    tint = GOOD if is_done else ACCENT
    icon = "\uf00c" if is_done or tour.step is None else tour.step.icon
    draw_list, position = imgui.get_window_draw_list(), imgui.get_cursor_screen_pos()
    draw_list.add_text(
        imgui.get_font(), _ICON_SIZE - 4, ImVec2(position.x, position.y), pack_colour(tint), icon
    )
    draw_list.add_text(
        imgui.get_font(),
        _SENTENCE_TEXT_SIZE,
        ImVec2(position.x + _ICON_SIZE + 12, position.y + 2),
        pack_colour(tint),
        tr(tour.title),
    )
    imgui.dummy(ImVec2(1, _ICON_SIZE))
    imgui.push_font(None, _SENTENCE_TEXT_SIZE)
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(_get_sentence(tour))
    imgui.pop_text_wrap_pos()
    imgui.pop_font()


def _draw_dots(tour: Tour) -> None:
    """Draws a dot for each step. The dots of finished steps are filled."""
    draw_list, position = imgui.get_window_draw_list(), imgui.get_cursor_screen_pos()
    for number in range(len(TOUR_STEPS)):
        middle = ImVec2(position.x + _DOT_RADIUS + number * 4 * _DOT_RADIUS, position.y + _DOT_RADIUS + 2)
        if number < tour.number or (number == tour.number and tour.done_display_s > 0.0):
            draw_list.add_circle_filled(middle, _DOT_RADIUS, pack_colour(GOOD))
        elif number == tour.number:
            draw_list.add_circle_filled(middle, _DOT_RADIUS + 1, pack_colour(ACCENT))
        else:
            draw_list.add_circle_filled(middle, _DOT_RADIUS - 1, pack_colour(QUIET, 0.45))
    imgui.dummy(ImVec2(1, 2 * _DOT_RADIUS + 4))


def _draw_buttons(app: App, tour: Tour, end: Callable[[], object]) -> None:
    """Draws the buttons: show me, back, skip or next, and later."""
    spacing = imgui.get_style().item_spacing.x
    button_width = (imgui.get_content_region_avail().x - 3 * spacing) / 4
    size = ImVec2(button_width, _BUTTON_HEIGHT)
    if tour.step is None:
        with push_fill(ACCENT):
            if imgui.button(labelled(tr(_CLOSE_LABEL), _CLOSE_LABEL), ImVec2(-1, _BUTTON_HEIGHT)):
                end()
        app.remember("tour close")
        return
    part = tour.part
    imgui.begin_disabled(part is None or tour.is_demonstrating or part.waits)
    with push_fill(ACCENT):
        if imgui.button(labelled(tr(_SHOW_LABEL), _SHOW_LABEL), size):
            mouse = imgui.get_io().mouse_pos
            tour.demonstrate_step((mouse.x, mouse.y))
    imgui.end_disabled()
    app.remember("tour show")
    imgui.same_line()
    imgui.begin_disabled(tour.number == 0)
    if imgui.button(labelled(tr(_BACK_LABEL), _BACK_LABEL), size):
        tour.back()
    imgui.end_disabled()
    app.remember("tour back")
    imgui.same_line()
    if imgui.button(labelled(tr(_NEXT_LABEL if tour.reviewing else _SKIP_LABEL), "tour skip"), size):
        tour.skip()
    app.remember("tour skip")
    imgui.same_line()
    if imgui.button(labelled(tr(_LATER_LABEL), _LATER_LABEL), size):
        end()
    app.remember("tour later")


def _draw_bubble(tour: Tour, shape: Rectangle | None) -> Rectangle | None:
    """Draws only the sentence, next to its target in a dialogue. The card's buttons could not be clicked
    while a dialogue is open.
    """
    if shape is None:
        return None
    draw_list, size = imgui.get_foreground_draw_list(), imgui.get_io().display_size
    grown = _SENTENCE_TEXT_SIZE / imgui.get_font_size()
    text_size = imgui.calc_text_size(_get_sentence(tour))
    width, height = text_size.x * grown + 24, text_size.y * grown + 16
    x = min(max(shape[0], 8.0), size.x - width - 8.0)
    above, below = shape[1] - 14 - height, shape[3] + 14
    # If the target is a text field, draw the sentence above it, because the dialogue's buttons are below.
    is_field = shape[2] - shape[0] > size.x / 3
    y = above if is_field or below + height > size.y else below
    draw_list.add_rect_filled(ImVec2(x, y), ImVec2(x + width, y + height), pack_colour(DARK), 8.0)
    draw_list.add_rect(ImVec2(x, y), ImVec2(x + width, y + height), pack_colour(ACCENT, 0.7), 8.0, 1.5)
    draw_list.add_text(
        imgui.get_font(), _SENTENCE_TEXT_SIZE, ImVec2(x + 12, y + 8), pack_colour(INK), _get_sentence(tour)
    )
    return None


def _draw_outline(draw_list: imgui.ImDrawList, shape: Rectangle, *, calm: bool) -> None:
    """Draws a pulsing outline with a soft glow."""
    swell = 0.0 if calm else 0.5 + 0.5 * math.sin(2 * math.pi * imgui.get_time() / _PULSE_S)
    left, top, right, bottom = shape
    for margin, opacity in ((3 + 3 * swell, 0.25), (6 + 5 * swell, 0.12)):
        low, high = ImVec2(left - margin, top - margin), ImVec2(right + margin, bottom + margin)
        draw_list.add_rect(low, high, pack_colour(ACCENT, opacity), 9.0 + margin, _OUTLINE_WIDTH)
    draw_list.add_rect(ImVec2(left, top), ImVec2(right, bottom), pack_colour(ACCENT), 8.0, _OUTLINE_WIDTH)


def _draw_arrow(
    draw_list: imgui.ImDrawList, card: Rectangle, shape: Rectangle, widgets: list[Rectangle]
) -> None:
    """Draws an arrow from the direction of the card to the outline."""
    arrow = place_arrow(card, shape, widgets)
    if arrow is not None:
        draw_list.add_line(ImVec2(*arrow[0]), ImVec2(*arrow[1]), pack_colour(ACCENT), _OUTLINE_WIDTH)
        _draw_arrow_head(draw_list, *arrow)


def _draw_arrow_head(
    draw_list: imgui.ImDrawList, start: tuple[float, float], end: tuple[float, float]
) -> None:
    angle = math.atan2(end[1] - start[1], end[0] - start[0])
    sides = [
        ImVec2(
            end[0] - _ARROW_HEAD_SIZE * math.cos(angle + turn),
            end[1] - _ARROW_HEAD_SIZE * math.sin(angle + turn),
        )
        for turn in (0.5, -0.5)
    ]
    draw_list.add_triangle_filled(ImVec2(*end), sides[0], sides[1], pack_colour(ACCENT))


def _draw_drag_path(draw_list: imgui.ImDrawList, points: list[ImVec2]) -> None:
    """Draws the drag path: dashes, with a dot at the start and an arrow at the end."""
    for start, end in itertools.pairwise(points):
        length = math.dist((start.x, start.y), (end.x, end.y))
        if length < 1.0:
            continue
        across, down = (end.x - start.x) / length, (end.y - start.y) / length
        distance = 0.0
        while distance < length - _ARROW_HEAD_SIZE:
            stop = min(distance + _DASH_LENGTH, length - _ARROW_HEAD_SIZE)
            low = ImVec2(start.x + distance * across, start.y + distance * down)
            high = ImVec2(start.x + stop * across, start.y + stop * down)
            draw_list.add_line(low, high, pack_colour(DARK, 0.7), _OUTLINE_WIDTH + 3)
            draw_list.add_line(low, high, pack_colour(ACCENT), _OUTLINE_WIDTH)
            distance += 2 * _DASH_LENGTH
        _draw_arrow_head(draw_list, (start.x, start.y), (end.x, end.y))
    draw_list.add_circle_filled(points[0], 7.0, pack_colour(DARK, 0.7))
    draw_list.add_circle_filled(points[0], 5.0, pack_colour(ACCENT))


def _draw_hand(app: App, tour: Tour) -> None:
    """Draws the hand of a demonstration, and passes the letters that it types to ImGui."""
    showing = tour.demonstration
    if showing is None:
        return
    typed = showing.take_typed()
    if typed:
        imgui.get_io().add_input_characters_utf8(typed)
    draw_list = imgui.get_foreground_draw_list()
    x, y = showing.hand
    if showing.presses:
        draw_list.add_circle(ImVec2(x, y), 15.0, pack_colour(ACCENT), 0, 3.0)
    for dx, dy, colour in ((1.5, 2.0, pack_colour(DARK)), (0.0, 0.0, pack_colour(INK))):
        position = ImVec2(x - 0.36 * _HAND_SIZE + dx, y - 0.1 * _HAND_SIZE + dy)
        draw_list.add_text(imgui.get_font(), _HAND_SIZE, position, colour, "\uf0a6")
    if showing.shift:
        text = tr("Shift")
        draw_list.add_rect_filled(ImVec2(x + 20, y + 22), ImVec2(x + 74, y + 48), pack_colour(DARK), 6.0)
        draw_list.add_rect(ImVec2(x + 20, y + 22), ImVec2(x + 74, y + 48), pack_colour(INK), 6.0, 1.5)
        draw_list.add_text(ImVec2(x + 30, y + 27), pack_colour(INK), text)
