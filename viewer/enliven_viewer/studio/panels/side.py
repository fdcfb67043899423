"""The panel at the right: shapes, the selected shape and layer, and takes."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from enliven.document import Layer, Project, Shape
from enliven.modeling.edits import change_layers, rename_character
from enliven.motion.layers import set_travel
from enliven_viewer.studio.editor import Edit
from enliven_viewer.studio.panels.style import heading, panel, quiet
from enliven_viewer.studio.places import Area
from enliven_viewer.studio.tools import MapTool
from enliven_viewer.studio.viewport import default_colour
from enliven_viewer.studio.workspace import Workspace

_HALF = ImVec2(126, 0)
_MEANT = {
    "To equal limbs": "Give the motion of the chosen limb to all limbs that are equal to it",
    "Clear motion": "Take all motion off the chosen chain, or off the shape",
    "Mirror": "Left to right, as you look at it",
}


def draw_side(workspace: Workspace, area: Area) -> None:
    """Draw the right panel."""
    with panel("side", area):
        _shapes(workspace)
        if workspace.editor.selection.shape is not None:
            _chosen_shape(workspace, workspace.editor.selection.shape)
        if workspace.editor.selection.layer is not None:
            _chosen_layer(workspace, *workspace.editor.selection.layer)
        _takes(workspace)


def _shapes(workspace: Workspace) -> None:
    heading("Shapes")
    editor = workspace.editor
    project = editor.project
    if not project.shapes and not project.graphs and not project.puppets:
        quiet("Nothing yet. Sketch a part (S), or open a model or a mesh (Ctrl+O).")
    for name in project.puppets:
        if imgui.selectable(f"{name}   puppet##puppet", editor.selection.puppet == name)[0]:
            editor.puppets.choose(name)
            workspace.input.take("puppet")
        workspace.remember(f"puppet {name}")
    for name in editor.project.graphs:
        if imgui.selectable(f"{name}   possessed##graph", editor.selection.graph == name)[0]:
            editor.select(graph=name)
        workspace.remember(f"graph {name}")
    for shape in editor.project.shapes.values():
        colour = default_colour(shape.id)
        flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop
        tint = ImVec4(colour[0] / 255, colour[1] / 255, colour[2] / 255, 1.0)
        imgui.color_button(f"##clay {shape.id}", tint, flags, ImVec2(14, 14))
        imgui.same_line()
        if imgui.selectable(f"{shape.id}##shape", editor.selection.shape == shape.id)[0]:
            editor.select(shape=shape.id)
        workspace.remember(f"shape {shape.id}")


def _chosen_shape(workspace: Workspace, name: str) -> None:
    editor, commands = workspace.editor, workspace.input.commands
    shape = editor.project.shapes[name]
    heading("Chosen shape")
    imgui.set_next_item_width(-1)
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    typed, wanted = imgui.input_text("##name", name, flags)
    workspace.remember("name")
    if typed and wanted.strip() and wanted != name:
        if editor.edit("rename", lambda project: rename_character(project, name, wanted.strip())):
            editor.select(shape=wanted.strip())
        return
    bones = len(shape.skeleton) - 1
    surface = f"{len(shape.mesh.vertices):,} vertices" if shape.mesh is not None else "no surface"
    node = editor.selection.joint
    told = f"{bones} bone{'s' * (bones != 1)}, {surface}"
    quiet(told if node is None else f"{told}, node {shape.skeleton.names[node]}")
    for label, command in (
        ("Duplicate", commands.duplicate),
        ("Mirror", commands.mirror),
        ("Larger", lambda: commands.scale(1.1)),
        ("Smaller", lambda: commands.scale(1 / 1.1)),
        ("Turn left", lambda: commands.turn(15.0)),
        ("Turn right", lambda: commands.turn(-15.0)),
        ("To equal limbs", commands.spread),
        ("Clear motion", commands.clear_motion),
    ):
        if imgui.button(label, _HALF):
            command()
        workspace.remember(f"do {label}")
        if label in _MEANT and imgui.is_item_hovered():
            imgui.set_tooltip(_MEANT[label])
        if label in ("Duplicate", "Larger", "Turn left", "To equal limbs"):
            imgui.same_line()


def _chosen_layer(workspace: Workspace, character: str, number: int) -> None:
    editor, at = workspace.editor, (character, number)
    layer = editor.project.characters[character].playing[number]
    heading("Chosen motion")
    imgui.text_unformatted(getattr(layer, "id", character))
    quiet(f"take {layer.take}")
    if isinstance(layer, Layer):
        _slider(workspace, at, "weight", layer.weight, 0.0, 1.0, "weight %.2f")
    _slider(workspace, at, "offset", layer.offset, -5.0, 5.0, "begins at %.2f s")
    _slider(workspace, at, "speed", layer.speed, -3.0, 3.0, "speed %.2f")
    for label in ("loop", "muted"):
        toggled, on = imgui.checkbox(label, getattr(layer, label))
        if toggled:
            editor.edit(label, _setting(at, label, on))
        if label == "loop":
            imgui.same_line()
    if isinstance(layer, Layer):
        _chain(workspace, editor.project.shape(character), layer, at)


def _chain(workspace: Workspace, shape: Shape, layer: Layer, at: tuple[str, int]) -> None:
    """Draw what only a layer of bones has: whether it leads the end, and whether the root travels."""
    editor = workspace.editor
    ends = layer.mode == "end"
    toggled, on = imgui.checkbox("lead the end", ends)
    if imgui.is_item_hovered():
        imgui.set_tooltip("Bend the chain so that its end goes where the take's end goes")
    if toggled:
        editor.edit("lead the end", _setting(at, "mode", "end" if on else "turns"))
    imgui.same_line()
    toggled, on = imgui.checkbox("root travels", shape.travel == layer.id)
    if imgui.is_item_hovered():
        imgui.set_tooltip("The shape goes where the take's root goes. P keeps chosen feet where they stand.")
    if toggled:
        wanted = layer.id if on else None
        editor.edit("root travels", lambda project: set_travel(project, shape.id, wanted))


def _slider(
    workspace: Workspace, at: tuple[str, int], name: str, value: float, low: float, high: float, said: str
) -> None:
    """Draw a slider of a layer's number: a draft while it is dragged, one edit when it is let go."""
    imgui.set_next_item_width(-1)
    changed, wanted = imgui.slider_float(f"##{name}", value, low, high, said)
    workspace.remember(f"layer {name}")
    if changed and (name != "speed" or abs(wanted) > 0.02):
        workspace.editor.sketch(lambda project: _changed(project, at, name, wanted))
    if imgui.is_item_deactivated_after_edit():
        last = getattr(workspace.editor.project.characters[at[0]].playing[at[1]], name)
        workspace.editor.edit(f"change {name}", lambda project: _changed(project, at, name, last))


def _setting(at: tuple[str, int], name: str, value: object) -> Edit:
    return lambda project: _changed(project, at, name, value)


def _changed(project: Project, at: tuple[str, int], name: str, value: object) -> Project:
    return change_layers(project, at[0], [at[1]], **{name: value})


def _takes(workspace: Workspace) -> None:
    editor = workspace.editor
    heading("Takes")
    used = set().union(*(one.needed()["takes"] for one in editor.project.characters.values()))
    mapping = workspace.input.tools["map"]
    assert isinstance(mapping, MapTool)
    for name, take in editor.project.takes.items():
        shown = mapping.source.take == name and workspace.input.tool is mapping
        label = f"{name}   {take.duration:.1f} s" + ("  · in use" if name in used else "")
        if imgui.selectable(f"{label}##take {name}", shown)[0]:
            workspace.input.take("map")
            mapping.source.show(name)
        workspace.remember(f"take {name}")
