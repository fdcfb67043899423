"""The panel at the right: shapes, takes, and what can be said of what is chosen."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, ImVec4, imgui

from enliven_viewer.studio.desk import Desk
from enliven_viewer.studio.panels.style import heading, panel, quiet
from enliven_viewer.studio.places import Area
from enliven_viewer.studio.viewport import clay_of


def draw_side(desk: Desk, area: Area) -> None:
    """Everything in the right panel."""
    with panel("side", area):
        _shapes(desk)
        _chosen_shape(desk)
        _chosen_layer(desk)


def _shapes(desk: Desk) -> None:
    heading("Shapes")
    editor = desk.editor
    if not editor.project.shapes:
        quiet("Nothing yet. Sketch a part (S), or open a model (Ctrl+O).")
    for shape in editor.project.shapes.values():
        clay = clay_of(shape.id)
        flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop
        tint = ImVec4(clay[0] / 255, clay[1] / 255, clay[2] / 255, 1.0)
        imgui.color_button(f"##clay {shape.id}", tint, flags, ImVec2(14, 14))
        imgui.same_line()
        chosen = editor.selection.shape == shape.id
        if imgui.selectable(f"{shape.id}##shape", chosen)[0]:
            editor.select(shape=shape.id)
        desk.remember(f"shape {shape.id}")


def _chosen_shape(desk: Desk) -> None:
    editor = desk.editor
    if editor.selection.shape is None:
        return
    shape = editor.project.shapes[editor.selection.shape]
    heading("Chosen")
    bones = len(shape.skeleton) - 1
    surface = f"{len(shape.mesh.vertices):,} vertices" if shape.mesh is not None else "no surface"
    quiet(f"{bones} bone{'s' * (bones != 1)}, {surface}")
    if editor.selection.joint is not None:
        quiet(f"node {shape.skeleton.names[editor.selection.joint]}")


def _chosen_layer(desk: Desk) -> None:
    editor = desk.editor
    if editor.selection.layer is None:
        return
    layer = editor.project.layers[editor.selection.layer]
    heading("Layer")
    imgui.text(layer.id)

    def change(name: str, **changes: object) -> None:
        editor.edit(name, lambda project: project.with_layers(replace(layer, **changes)))  # type: ignore[arg-type]

    imgui.set_next_item_width(-70)
    changed, weight = imgui.slider_float("weight", layer.weight, 0.0, 1.0, "%.2f")
    if changed:
        held = editor.project.layers[layer.id]
        editor.sketch(lambda project: project.with_layers(replace(held, weight=weight)))
    if imgui.is_item_deactivated_after_edit():
        change("weight", weight=editor.project.layers[layer.id].weight)
    toggled, loop = imgui.checkbox("loop", layer.loop)
    if toggled:
        change("loop", loop=loop)
    imgui.same_line()
    toggled, muted = imgui.checkbox("mute", layer.muted)
    if toggled:
        change("mute", muted=muted)
