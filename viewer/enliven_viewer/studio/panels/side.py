"""The panel at the right: all characters, the chosen one and its layer, and takes."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from enliven.document import RigBase
from enliven_viewer.studio.panels.fields import character_name
from enliven_viewer.studio.panels.layer import draw_layer
from enliven_viewer.studio.panels.modal import action_button
from enliven_viewer.studio.panels.style import heading, panel, quiet
from enliven_viewer.studio.places import Area
from enliven_viewer.studio.tools import MapTool
from enliven_viewer.studio.viewport import default_colour
from enliven_viewer.studio.workspace import Workspace

_HALF = 126.0
"""Pixels of a button: two are side by side."""
_DEEDS = (
    "edit.duplicate",
    "shape.mirror",
    "shape.larger",
    "shape.smaller",
    "shape.turn_left",
    "shape.turn_right",
)
_JOINTED = ("motion.spread", "motion.clear")
"""Actions that only characters with bones have."""


def draw_side(workspace: Workspace, area: Area) -> None:
    """Draw the right panel."""
    editor = workspace.editor
    with panel("side", area):
        _characters(workspace)
        chosen = editor.chosen()
        if chosen is not None:
            _chosen(workspace, chosen)
        chosen, layer = editor.chosen(), editor.selection.layer
        if chosen is not None and layer is not None:
            draw_layer(workspace, chosen, layer)
        _takes(workspace)


def _characters(workspace: Workspace) -> None:
    heading("Shapes")
    editor = workspace.editor
    if not editor.project.characters:
        quiet("Nothing yet. Sketch a part (S), or open a model or a mesh (Ctrl+O).")
    for name, character in editor.project.characters.items():
        colour = default_colour(name)
        flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop
        tint = ImVec4(colour[0] / 255, colour[1] / 255, colour[2] / 255, 1.0)
        imgui.color_button(f"##clay {name}", tint, flags, ImVec2(14, 14))
        imgui.same_line()
        if imgui.selectable(f"{name}   {character.word}##character", editor.selection.character == name)[0]:
            editor.choose(name)
            if editor.puppets.puppet is not None:
                workspace.input.take("puppet")
        workspace.remember(f"character {name}")


def _chosen(workspace: Workspace, character: RigBase) -> None:
    editor = workspace.editor
    heading(f"Chosen {character.word}")
    character_name(workspace, character)
    if editor.chosen() is not character:
        return
    jointed = bool((character.parents >= 0).any())
    bones, vertices = int((character.parents >= 0).sum()), character.mesh and len(character.mesh.vertices)
    said = [f"{bones} bone{'s' * (bones != 1)}"] if jointed else []
    said.append(f"{vertices:,} vertices" if vertices else "no surface")
    if editor.selection.handle is not None:
        said.append(f"node {character.handles[editor.selection.handle]}")
    quiet(", ".join(said))
    for place, action in enumerate((*_DEEDS, *_JOINTED) if jointed else _DEEDS):
        if place % 2:
            imgui.same_line()
        action_button(workspace, action, _HALF)


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
