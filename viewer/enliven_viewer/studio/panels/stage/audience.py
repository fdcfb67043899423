"""Draws text for an audience: performers with their characters, or a notice while the edge is silent."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.live.hud import Hud
from enliven_viewer.live.match_cards import make_cards
from enliven_viewer.render.overlay.canvas import Pen
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import pack_colour
from enliven_viewer.studio.panels.stage.live import draw_holders, draw_size
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import GLASS, INK

_TEXT_SIZE = 26.0
"""Text size in pixels of the notice: readable from the back of a room."""
_BOTTOM_MARGIN = 72.0
"""Distance in pixels between the notice and the bottom of the view."""


def draw_audience(workspace: Workspace, area: Area, notice: str) -> None:
    """Draws over the whole view; ``notice`` is shown while the stage is away, else empty."""
    live = workspace.perform.live
    draw_list = imgui.get_background_draw_list()
    if not workspace.asking:
        imgui.set_mouse_cursor(imgui.MouseCursor_.none)
    if notice:
        _draw_sentence(draw_list, area, tr(notice))
    elif live is not None:
        cards = make_cards(live.scene, workspace.editor.lens.view)
        Hud(Pen(draw_list, (area.x, area.y))).draw_choice((round(area.width), round(area.height)), cards, "")
        draw_holders(workspace.perform, draw_list, area)
        draw_size(workspace.perform, draw_list, area)


def _draw_sentence(draw_list: imgui.ImDrawList, area: Area, text: str) -> None:
    """Draws one sentence centred at the bottom."""
    width = imgui.calc_text_size(text).x / imgui.get_font_size()
    size = min(_TEXT_SIZE, (area.width - 80.0) / max(width, 1.0))
    left, top = area.x + (area.width - width * size) / 2, area.y + area.height - _BOTTOM_MARGIN
    low, high = ImVec2(left - 26, top - 12), ImVec2(left + width * size + 26, top + size + 12)
    draw_list.add_rect_filled(low, high, pack_colour((*GLASS[:3], 0.85)), 14.0)
    draw_list.add_text(imgui.get_font(), size, ImVec2(left, top), pack_colour(INK), text)
