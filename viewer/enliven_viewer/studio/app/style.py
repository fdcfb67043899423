"""Fonts and colours of the studio's widgets, and small helpers that panels share."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from imgui_bundle import ImVec2, ImVec4, hello_imgui, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.theme import (
    ACCENT,
    CLEAR,
    DARK,
    DIMMED,
    FAINT,
    FONT,
    GLASS,
    INK,
    LINE,
    ON_FILL,
    PANEL,
    POPUP,
    PRESSED,
    QUIET,
    RAISED,
    Colour,
    is_light,
)

BODY_TEXT_SIZE = 15.0
"""Default text size in pixels."""
SMALL_TEXT_SIZE = 12.5
"""Size in pixels of small text, such as the labels of timeline rows."""
EYE_ICON, CLOSED_EYE_ICON = "\uf06e", "\uf070"
"""Font Awesome 4 icons of an active layer and of a muted layer."""
_PADDING = 6.0
"""Pixels above the first line of a list and below its last."""
ACCENT_OPACITY_UNDER_TEXT = 0.40
"""Opacity of the accent colour behind text, such as the value of a slider, so that the text stays
readable.
"""
FIXED_WINDOW_FLAGS = (
    imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_collapse
    | imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_bring_to_front_on_focus
)


def load_fonts() -> None:
    """Loads Roboto with Font Awesome's glyphs."""
    hello_imgui.load_font_ttf_with_font_awesome_icons(FONT, BODY_TEXT_SIZE)


def apply_style() -> None:
    """Applies the style: glass panels, amber accents, round corners."""
    style = imgui.get_style()
    style.window_rounding = style.popup_rounding = 8.0
    style.frame_rounding = style.grab_rounding = style.tab_rounding = 5.0
    style.child_rounding = 6.0
    style.window_border_size = style.frame_border_size = 0.0
    style.popup_border_size = 1.0
    style.window_padding, style.item_spacing = ImVec2(12, 10), ImVec2(8, 6)
    style.frame_padding = ImVec2(8, 4)
    style.scrollbar_size = 11.0
    apply_colours()


def apply_colours() -> None:
    """Sets the widgets' colours to those of the current theme."""
    style, kind = imgui.get_style(), imgui.Col_
    if is_light():
        imgui.style_colors_light()
    else:
        imgui.style_colors_dark()
    amber = (ACCENT[0], ACCENT[1], ACCENT[2])
    colours = {
        kind.text: INK,
        kind.text_disabled: FAINT,
        kind.window_bg: PANEL,
        kind.child_bg: CLEAR,
        kind.popup_bg: POPUP,
        kind.border: LINE,
        kind.menu_bar_bg: DARK,
        kind.frame_bg: RAISED,
        kind.frame_bg_hovered: PRESSED,
        kind.frame_bg_active: PRESSED,
        kind.button: RAISED,
        kind.button_hovered: PRESSED,
        kind.button_active: (*amber, 0.45),
        kind.header: (*amber, 0.26),
        kind.header_hovered: (*amber, 0.18),
        kind.header_active: (*amber, 0.40),
        kind.check_mark: ACCENT,
        kind.slider_grab: (*amber, ACCENT_OPACITY_UNDER_TEXT),
        kind.slider_grab_active: (*amber, ACCENT_OPACITY_UNDER_TEXT),
        kind.plot_histogram: (*amber, ACCENT_OPACITY_UNDER_TEXT),
        kind.separator: LINE,
        kind.scrollbar_bg: CLEAR,
        kind.scrollbar_grab: PRESSED,
        kind.title_bg_active: DARK,
        kind.title_bg: DARK,
        kind.text_selected_bg: (*amber, 0.35),
        kind.nav_cursor: (*amber, 0.6),
        kind.modal_window_dim_bg: DIMMED,
    }
    for colour_slot, colour in colours.items():
        style.set_color_(colour_slot, ImVec4(*colour))


def pack_colour(colour: Colour, opacity: float = 1.0) -> int:
    """Returns a colour as the packed 32-bit integer of ImGui draw lists."""
    return imgui.get_color_u32(ImVec4(colour[0], colour[1], colour[2], colour[3] * opacity))


@contextmanager
def open_panel(name: str, area: Area, flags: int = 0) -> Iterator[None]:
    """Opens an ImGui window with a fixed position and size."""
    imgui.set_next_window_pos(ImVec2(area.x, area.y))
    imgui.set_next_window_size(ImVec2(area.width, area.height))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
    imgui.begin(name, None, FIXED_WINDOW_FLAGS | flags)
    imgui.pop_style_var()
    yield
    imgui.end()


@contextmanager
def open_list_box(name: str, height: float) -> Iterator[float]:
    """Opens a scrolling box of fixed height, so that new contents do not move the widgets below it.

    Yields:
        The width in pixels of its lines, the same with and without a scrollbar.
    """
    style = imgui.get_style()
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(style.frame_padding.x, _PADDING))
    imgui.begin_child(f"##{name}", ImVec2(0, height), imgui.ChildFlags_.borders)
    imgui.pop_style_var()
    yield imgui.get_window_width() - 2 * style.frame_padding.x - style.scrollbar_size
    imgui.end_child()


@contextmanager
def push_colours(colour: Colour, *which: int) -> Iterator[None]:
    """Applies a colour to everything inside the context."""
    for style_colour in which:
        imgui.push_style_color(style_colour, ImVec4(*colour))
    yield
    imgui.pop_style_color(len(which))


@contextmanager
def push_fill(colour: Colour) -> Iterator[None]:
    """Fills every button inside the context with ACCENT, GOOD, WAIT or BAD, and makes its text readable."""
    kinds = (imgui.Col_.button, imgui.Col_.button_hovered, imgui.Col_.button_active)
    with push_colours(colour, *kinds), push_colours(ON_FILL, imgui.Col_.text):
        yield


@contextmanager
def use_small_text() -> Iterator[None]:
    """Uses the small text size inside the context."""
    imgui.push_font(None, SMALL_TEXT_SIZE)
    yield
    imgui.pop_font()


def draw_caption(
    draw_list: imgui.ImDrawList, position: ImVec2, text: str, colour: Colour, size: float
) -> None:
    """Draws a line of text over an image, on a glass background so that it is readable on any image."""
    grown = size / imgui.get_font_size()
    extent = imgui.calc_text_size(text)
    low = ImVec2(position.x - 5, position.y - 2)
    high = ImVec2(position.x + grown * extent.x + 5, position.y + grown * extent.y + 2)
    draw_list.add_rect_filled(low, high, pack_colour((*GLASS[:3], 0.85)), 5.0)
    draw_list.add_text(imgui.get_font(), size, position, pack_colour(colour), text)


def draw_heading(text: str) -> None:
    """Draws the title of a panel section."""
    imgui.dummy(ImVec2(0, 2))
    with use_small_text(), push_colours(QUIET, imgui.Col_.text):
        imgui.text(tr(text).upper())
    imgui.separator()


def draw_note(text: str) -> None:
    """Draws a wrapped line of secondary text."""
    with use_small_text(), push_colours(QUIET, imgui.Col_.text):
        imgui.push_text_wrap_pos(0.0)
        imgui.text_unformatted(tr(text))
        imgui.pop_text_wrap_pos()


def convert_to_screen_pixels(width: float, height: float) -> tuple[int, int]:
    """Returns the size in screen pixels for a size in logical pixels. It is at least 1."""
    scale = imgui.get_io().display_framebuffer_scale.y
    return max(round(width * scale), 1), max(round(height * scale), 1)
