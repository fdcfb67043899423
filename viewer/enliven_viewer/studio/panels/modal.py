"""Modal dialogues over the window, and their buttons."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.workspace.workspace import Workspace

_WINDOW_FLAGS = (
    imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_saved_settings
)
_MARGIN = 24.0
"""Margin in pixels around a dialogue in a small window."""


@contextmanager
def open_modal(title: str, width: float, height: float = 0.0, flags: int = 0) -> Iterator[bool]:
    """Opens a centred dialogue with a size in pixels. 0 fits the contents. Yields True if it is drawn."""
    title = f"{tr(title)}###{title}"
    imgui.open_popup(title)
    view = imgui.get_main_viewport()
    available_size = ImVec2(view.size.x - _MARGIN, view.size.y - _MARGIN)
    imgui.set_next_window_pos(view.get_center(), imgui.Cond_.always, ImVec2(0.5, 0.5))
    imgui.set_next_window_size(ImVec2(min(width, available_size.x), min(height, available_size.y)))
    shown = bool(imgui.begin_popup_modal(title, None, _WINDOW_FLAGS | flags)[0])
    yield shown
    if shown:
        imgui.end_popup()


def draw_button(workspace: Workspace, label: str) -> bool:
    """Draws a dialogue button and records its rectangle. Returns True if it was pressed."""
    width = max(imgui.calc_text_size(tr(label)).x + 20.0, 110.0)
    is_pressed = imgui.button(f"{tr(label)}###{label}", ImVec2(width, 0))
    workspace.remember(f"dialog {label}")
    return bool(is_pressed)


def draw_choice(workspace: Workspace, yes: str, no: str) -> bool:
    """Draws two buttons. Returns True if the first was pressed. The second button, and Escape, close the
    dialogue.
    """
    is_pressed = draw_button(workspace, yes)
    imgui.same_line()
    if draw_button(workspace, no) or imgui.is_key_pressed(imgui.Key.escape):
        workspace.cancel()
    return is_pressed
