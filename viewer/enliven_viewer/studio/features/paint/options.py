"""Draws the options of the brush in the panel at the right."""

from __future__ import annotations

from imgui_bundle import imgui

from enliven.document import FREE, Project
from enliven.modeling.edits import handle_characters
from enliven.wire import MAX_EXAGGERATION
from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_action_button, draw_slider, draw_tooltip
from enliven_viewer.studio.app.style import draw_heading, draw_note
from enliven_viewer.studio.features.paint.paint_tool import BRUSHES, MAX_RADIUS_PX, MIN_RADIUS_PX, PaintTool

_BUTTON_WIDTH = 252.0
"""Width in pixels of the button that clears the paint: the panel's width."""
_SWING_TITLE = later("of soft areas")
"""Name of the slider's value in the undo history."""


def draw_brush_options(app: App, tool: PaintTool) -> None:
    """Draws the options of the stiffness brush."""
    draw_heading("Brush")
    for number, (brush, label) in enumerate(BRUSHES.items()):
        if number:
            imgui.same_line()
        if imgui.radio_button(f"{tr(label)}###brush {brush}", tool.brush == brush):
            app.actions.do(f"paint.{brush}")
        app.remember(f"brush {brush}")
        draw_tooltip(app.actions.make_tooltip(app.actions[f"paint.{brush}"]))
    imgui.set_next_item_width(-1)
    tool.radius = imgui.slider_float("##brush", tool.radius, MIN_RADIUS_PX, MAX_RADIUS_PX, tr("size %.0f"))[1]
    app.remember("brush size")
    draw_tooltip("Size of the brush. The keys [ and ] change it")
    if imgui.checkbox(labelled(tr("Both sides"), "Both sides"), tool.both_sides)[0]:
        app.actions.do("paint.both_sides")
    app.remember("both sides")
    draw_tooltip(app.actions.make_tooltip(app.actions["paint.both_sides"]))
    character = app.editor.find_selected()
    if character is not None and character.mesh is not None and character.is_possessable:
        _draw_swing(app, character.id)
    draw_action_button(app, "paint.clear", _BUTTON_WIDTH)
    draw_note(
        "The paint takes effect once a performer possesses the mesh. Soft areas swing further than the "
        "performer moves."
    )


def _draw_swing(app: App, name: str) -> None:
    """Draws the slider for the exaggeration of soft parts.

    It takes effect on the stage during the drag.
    """
    project = app.editor.draft or app.editor.project
    exaggeration = project.handling.get(name, FREE).exaggeration
    far = 1.0 if exaggeration is None else exaggeration

    def change(project: Project, wanted: float) -> Project:
        return handle_characters(project, [name], exaggeration=wanted)

    draw_slider(app, f"swing {_SWING_TITLE}", far, 0.0, MAX_EXAGGERATION, tr("swing %.1f"), change)
    draw_tooltip(
        "How much further soft areas swing than the performer moves. 0: not at all. 1: like a mass on a "
        "spring"
    )
