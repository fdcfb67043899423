"""Draws the list of a puppet layer's hard constraints. Each of them applies to one frame."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven.document import Coupling, ExampleCharacter, Position, Velocity
from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.style import draw_heading, draw_note, use_small_text
from enliven_viewer.studio.puppets.example_edits import (
    HardConstraint,
    describe_constraint,
    find_layer_number,
    list_constraints,
    remove_constraint_from,
    with_constraint,
)
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor

_REMOVE_ICON = "\uf00d"


def draw_constraints(app: App, puppet: ExampleCharacter) -> None:
    """Lists the hard constraints of the layer's take."""
    number = find_layer_number(puppet, app.editor.selection.layer)
    constraints = list_constraints(app.editor.project, puppet.id, number) if number is not None else ()
    if number is None or not constraints:
        return
    draw_heading("Constraints at single frames")
    for row, constraint in enumerate(constraints):
        _draw_constraint_row(app, puppet, number, row, constraint)


def draw_constraint_buttons(app: App, puppet: ExampleCharacter) -> None:
    """Draws the buttons that add a hard constraint of the selected control point at the playhead."""
    editor, chosen = app.editor, get_puppet_editor(app.editor).point
    number = find_layer_number(puppet, editor.selection.layer)
    if chosen is None or number is None:
        return
    draw_note("fix the point at the playhead")
    take = editor.project.takes[puppet.layers[number].take]
    frame = round(puppet.layers[number].find_played_time(editor.time, take.duration)[0] / take.step)
    name = puppet.points[chosen].name
    third = ImVec2((imgui.get_content_region_avail().x - 16) / 3, 0)
    new_constraint: HardConstraint | None = None
    if imgui.button(labelled(tr("Here"), "Here"), third):
        x, y, z = get_puppet_editor(editor).current_places(puppet)[chosen].tolist()
        new_constraint = Position(name, frame, (x, y, z))
    app.remember("hold here")
    draw_tooltip(tr("Fixes {0} at its current place in this frame", name))
    imgui.same_line()
    if imgui.button(labelled(tr("Still"), "Still"), third):
        new_constraint = Velocity(name, max(frame, 1), (0.0, 0.0, 0.0))
    app.remember("hold still")
    draw_tooltip(tr("Stops {0} in this frame", name))
    imgui.same_line()
    imgui.set_next_item_width(third.x)
    if imgui.begin_combo("##level", tr("Level")):
        for other in (point.name for point in puppet.points if point.name != name):
            if imgui.selectable(labelled(tr("with {0}", other), f"with {other}"), False)[0]:
                new_constraint = Coupling(name, other, frame)
        imgui.end_combo()
    app.remember("hold level")
    draw_tooltip(tr("Gives {0} the height of another control point in this frame", name))
    if new_constraint is not None:
        editor.edit(
            later("fix {0}", name),
            lambda project: with_constraint(project, puppet.id, number, new_constraint),
        )


def _draw_constraint_row(
    app: App, puppet: ExampleCharacter, number: int, row: int, held: HardConstraint
) -> None:
    """Draws one constraint. A click goes to its frame, and the cross removes it."""
    editor = app.editor
    take = editor.project.takes[puppet.layers[number].take]
    width = imgui.get_content_region_avail().x
    with use_small_text():
        if imgui.selectable(
            f"{describe_constraint(held, take.step)}###held {row}", False, 0, ImVec2(width - 30, 0)
        )[0]:
            editor.scrub(puppet.layers[number].time_of(held.frame * take.step, take.duration))
        imgui.same_line(width - 12)
        if imgui.small_button(f"{_REMOVE_ICON}##held {row}"):
            editor.edit(
                "remove constraint", lambda project: remove_constraint_from(project, puppet.id, number, held)
            )
        app.remember(f"let go {row}")
