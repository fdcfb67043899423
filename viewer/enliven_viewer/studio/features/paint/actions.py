"""The actions of the brush that paints stiffness weights."""

from __future__ import annotations

from collections.abc import Iterator

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.app.viewport_input import ViewportInput
from enliven_viewer.studio.editor.selection_actions import require_single_shape
from enliven_viewer.studio.features.paint.paint_tool import BRUSHES, RADIUS_STEP, PaintTool

_MENU = "Brush"
"""The submenu of the brush in the Shape menu."""
_BRUSH_KEYS = {"softer": "shift+w", "stiffer": "shift+q", "erase": "shift+e"}
_BRUSH_DESCRIPTIONS = {
    "softer": "Brush strokes make the mesh softer. Soft areas swing further than the performer moves.",
    "stiffer": "Brush strokes make the mesh stiffer. Stiff areas keep their form.",
    "erase": "Brush strokes remove the paint from the mesh.",
}


def make_painting_actions(user_input: ViewportInput, tool: PaintTool) -> Iterator[Action]:
    """Yields the brush actions. Actions that choose a brush mode also activate the brush."""

    def take(brush: str) -> None:
        user_input.activate_tool(PaintTool.name)
        tool.brush = brush  # type: ignore[assignment]

    def both_sides() -> None:
        tool.both_sides = not tool.both_sides

    for brush, word in BRUSHES.items():
        yield Action(
            f"paint.{brush}",
            "Shape",
            f"Brush: {word[0].lower()}{word[1:]}",
            (_BRUSH_KEYS[brush],),
            lambda brush=brush: take(brush),
            is_on=lambda brush=brush: user_input.tool is tool and tool.brush == brush,
            about=_BRUSH_DESCRIPTIONS[brush],
            apart=brush == "softer",
            group=_MENU,
        )
    sizes = (("larger", "right_bracket", RADIUS_STEP), ("smaller", "left_bracket", 1 / RADIUS_STEP))
    for name, key, step in sizes:
        label = f"{name.title()} brush"
        yield Action(
            f"paint.{name}", "Shape", label, (key,), lambda step=step: tool.resize(step), group=_MENU
        )
    yield Action(
        "paint.both_sides",
        "Shape",
        "Paint both sides",
        ("shift+y",),
        both_sides,
        is_on=lambda: tool.both_sides,
        group=_MENU,
        about="Paints the left and the right side at once, if the mesh is symmetric.",
    )
    clear = Action(
        "paint.clear",
        "Shape",
        "Clear the paint",
        ("alt+y",),
        tool.clear,
        tool.describe_missing_paint,
        group=_MENU,
        about="Removes all paint, so that the whole mesh is equally stiff.",
    )
    yield require_single_shape(clear, tool.editor)
