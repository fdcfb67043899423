"""Registers painting: the brush with its actions and options."""

from __future__ import annotations

from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.features.paint.actions import make_painting_actions
from enliven_viewer.studio.features.paint.paint_tool import PaintTool


def register(app: App) -> None:
    """Registers painting."""
    brush = app.add_tool(PaintTool)

    def draw_options() -> None:
        # Imported late, so that a workspace without a window works without ImGui.
        from enliven_viewer.studio.features.paint.options import draw_brush_options

        draw_brush_options(app, brush)

    app.actions.add(*make_painting_actions(app.input, brush), after="shape.fit")
    app.tool_options[PaintTool.name] = draw_options
