"""Draws text for an audience: performers with their characters, or a notice while the edge is silent."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.live import Hud, cards_of
from enliven_viewer.render.overlay import Pen
from enliven_viewer.studio.panel_layout import Area
from enliven_viewer.studio.panels.stage.live import draw_holders, draw_size
from enliven_viewer.studio.panels.style import packed
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import GLASS, INK

_TEXT_SIZE = 26.0
"""Text size in pixels of the notice: readable from the back of a room."""
_BOTTOM_MARGIN = 72.0
"""Distance in pixels between the notice and the bottom of the view."""


def draw_audience(workspace: Workspace, area: Area, words: str) -> None:
    """Draws over the whole view; ``words`` is a notice while the stage is away, else empty."""
    live = workspace.perform.live
    draw = imgui.get_background_draw_list()
    if not workspace.asking:
        imgui.set_mouse_cursor(imgui.MouseCursor_.none)
    if words:
        _sentence(draw, area, tr(words))
    elif live is not None:
        cards = cards_of(live.scene, workspace.editor.lens.view)
        Hud(Pen(draw, (area.x, area.y))).draw_choice((round(area.width), round(area.height)), cards, "")
        draw_holders(workspace.perform, draw, area)
        draw_size(workspace.perform, draw, area)


def _sentence(draw: imgui.ImDrawList, area: Area, text: str) -> None:
    """Draws one sentence centred at the bottom."""
    wide = imgui.calc_text_size(text).x / imgui.get_font_size()
    size = min(_TEXT_SIZE, (area.width - 80.0) / max(wide, 1.0))
    left, top = area.x + (area.width - wide * size) / 2, area.y + area.height - _BOTTOM_MARGIN
    low, high = ImVec2(left - 26, top - 12), ImVec2(left + wide * size + 26, top + size + 12)
    draw.add_rect_filled(low, high, packed((*GLASS[:3], 0.85)), 14.0)
    draw.add_text(imgui.get_font(), size, ImVec2(left, top), packed(INK), text)
