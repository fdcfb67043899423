"""The layer of the chosen puppet: its numbers, and the hard constraints at single frames."""

from __future__ import annotations

from typing import Any

from imgui_bundle import ImVec2, imgui

from enliven.document import Coupling, Position, Puppet, PuppetLayer, Velocity
from enliven.modeling.puppet import change_layer, remove_layer
from enliven_viewer.studio.examples import (
    HardConstraint,
    constraints_of,
    layer_of,
    with_constraint,
    without_constraint,
)
from enliven_viewer.studio.panels.style import heading, quiet, small
from enliven_viewer.studio.workspace import Workspace

_REMOVE = "\uf00d"
_TOLD = {
    "loop": "Begin again at the end",
    "muted": "It does not play",
    "mirrored": "Play the take's mirror image: left for right",
    "travel": "Go through the world with the performer, on its feet",
    "level_feet": "Where the weight goes from one foot to another, both have one height",
}
_WORDS = {"travel": "travels", "level_feet": "level feet"}


def draw_layer(workspace: Workspace, puppet: Puppet) -> None:
    """Draw the numbers of the chosen layer, or of the first."""
    editor = workspace.editor
    number = layer_of(puppet, editor.selection.puppet_layer)
    assert number is not None
    layer = puppet.layers[number]
    heading("Motion")
    wide = imgui.get_content_region_avail().x
    imgui.text_unformatted(layer.take)
    imgui.same_line(wide - 52)
    if imgui.small_button("Remove##layer"):
        editor.edit("remove a layer", lambda project: remove_layer(project, puppet.id, number))
        return
    workspace.remember("remove layer")
    _slider(workspace, puppet.id, number, layer, "weight", 0.0, 1.0, "weight %.2f")
    _slider(workspace, puppet.id, number, layer, "offset", -5.0, 30.0, "begins at %.2f s")
    _slider(workspace, puppet.id, number, layer, "speed", -3.0, 3.0, "speed %.2f")
    for name in ("loop", "muted", "travel", "level_feet", "mirrored"):
        toggled, on = imgui.checkbox(_WORDS.get(name, name), getattr(layer, name))
        workspace.remember(f"layer {name}")
        if imgui.is_item_hovered():
            imgui.set_tooltip(_TOLD[name])
        if toggled:
            change(workspace, puppet.id, number, _WORDS.get(name, name), **{name: on})
        if name in ("loop", "travel"):
            imgui.same_line(126)


def change(workspace: Workspace, puppet: str, number: int, word: str, **changes: Any) -> bool:
    """An edit of a layer's attributes."""
    return workspace.editor.edit(word, lambda project: change_layer(project, puppet, number, **changes))


def _slider(
    workspace: Workspace,
    puppet: str,
    number: int,
    layer: PuppetLayer,
    name: str,
    low: float,
    high: float,
    said: str,
) -> None:
    """Draw a slider of a layer's number: a draft while it is dragged, one edit when it is let go."""
    imgui.set_next_item_width(-1)
    changed, wanted = imgui.slider_float(f"##puppet {name}", getattr(layer, name), low, high, said)
    workspace.remember(f"layer {name}")
    if changed and (name != "speed" or abs(wanted) > 0.02):
        workspace.editor.sketch(lambda project: change_layer(project, puppet, number, **{name: wanted}))
    if imgui.is_item_deactivated_after_edit():
        last = getattr(workspace.editor.project.puppets[puppet].layers[number], name)
        change(workspace, puppet, number, f"change {name}", **{name: last})


def draw_held(workspace: Workspace, puppet: Puppet) -> None:
    """List the hard constraints of the layer's take."""
    number = layer_of(puppet, workspace.editor.selection.puppet_layer)
    found = constraints_of(workspace.editor.project, puppet.id, number) if number is not None else ()
    if number is None or not found:
        return
    heading("Held hard")
    for row, held in enumerate(found):
        _held_row(workspace, puppet, number, row, held)


def draw_holding(workspace: Workspace, puppet: Puppet) -> None:
    """Draw the buttons that add hard constraints of the chosen control point at the playhead."""
    editor, chosen = workspace.editor, workspace.editor.puppets.point
    number = layer_of(puppet, editor.selection.puppet_layer)
    if chosen is None or number is None:
        return
    quiet("hold it hard, at the playhead")
    take = editor.project.takes[puppet.layers[number].take]
    frame = round(puppet.layers[number].played(editor.time, take.duration)[0] / take.step)
    name = puppet.points[chosen].name
    third = ImVec2((imgui.get_content_region_avail().x - 16) / 3, 0)
    wanted: HardConstraint | None = None
    if imgui.button("Here", third):
        x, y, z = editor.puppets.shown(puppet)[chosen].tolist()
        wanted = Position(name, frame, (x, y, z))
    workspace.remember("hold here")
    if imgui.is_item_hovered():
        imgui.set_tooltip(f"{name} goes through this place at this frame")
    imgui.same_line()
    if imgui.button("Still", third):
        wanted = Velocity(name, max(frame, 1), (0.0, 0.0, 0.0))
    workspace.remember("hold still")
    if imgui.is_item_hovered():
        imgui.set_tooltip(f"{name} does not move at this frame")
    imgui.same_line()
    imgui.set_next_item_width(third.x)
    if imgui.begin_combo("##level", "Level"):
        for other in (point.name for point in puppet.points if point.name != name):
            if imgui.selectable(f"with {other}", False)[0]:
                wanted = Coupling(name, other, frame)
        imgui.end_combo()
    workspace.remember("hold level")
    if imgui.is_item_hovered():
        imgui.set_tooltip(f"{name} is as high as another control point at this frame")
    if wanted is not None:
        editor.edit(f"hold {name}", lambda project: with_constraint(project, puppet.id, number, wanted))


def _held_row(workspace: Workspace, puppet: Puppet, number: int, row: int, held: HardConstraint) -> None:
    """Draw one constraint: a click goes to its frame, the cross removes it."""
    editor = workspace.editor
    take = editor.project.takes[puppet.layers[number].take]
    wide = imgui.get_content_region_avail().x
    with small():
        if imgui.selectable(
            f"{constraint_text(held, take.step)}##held {row}", False, 0, ImVec2(wide - 30, 0)
        )[0]:
            editor.scrub(puppet.layers[number].time_of(held.frame * take.step, take.duration))
        imgui.same_line(wide - 12)
        if imgui.small_button(f"{_REMOVE}##held {row}"):
            editor.edit("let go", lambda project: without_constraint(project, puppet.id, number, held))
        workspace.remember(f"let go {row}")


def constraint_text(held: HardConstraint, step: float) -> str:
    """A hard constraint in a few words."""
    at = f"{held.frame * step:.2f} s"
    if isinstance(held, Position):
        return f"{held.point} goes through a place at {at}"
    if isinstance(held, Velocity):
        return f"{held.point} is still at {at}"
    return f"{held.point} is level with {held.other} at {at}"
