"""Panel fields that edit the project: numbers, switches and names."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui

from enliven.document import Project, RigBase
from enliven.modeling.edits import rename_character
from enliven_viewer.language import later, tr
from enliven_viewer.studio.workspace import Workspace

Change = Callable[[Project, float], Project]
"""An edit that applies a number."""


def tooltip(text: str) -> None:
    """Shows the tooltip of the last widget while the pointer rests on it."""
    if text and imgui.is_item_hovered():
        imgui.set_tooltip(tr(text))


def slider(
    workspace: Workspace, name: str, value: float, low: float, high: float, number_format: str, change: Change
) -> None:
    """Draws a slider: a draft during the drag, one edit at its end.

    Integer bounds make it an integer slider.
    """
    imgui.set_next_item_width(-1)
    if isinstance(low, int):
        changed, wanted = imgui.slider_int(f"##{name}", int(value), low, int(high), tr(number_format))
    else:
        # Use a logarithmic scale for a range over several powers of ten.
        flags = imgui.SliderFlags_.logarithmic if low > 0.0 and high / low > 1e3 else 0
        changed, wanted = imgui.slider_float(f"##{name}", value, low, high, tr(number_format), flags)
    workspace.remember(name)
    if changed:
        workspace.editor.sketch(lambda project: change(project, wanted))
    if imgui.is_item_deactivated_after_edit():
        last = wanted if changed else value
        workspace.editor.edit(
            later("change {0}", later(name.partition(" ")[2] or name)), lambda p: change(p, last)
        )


def switch(workspace: Workspace, label: str, on: bool, change: Change, tip: str = "") -> None:
    """Draws a checkbox; a click is one edit."""
    toggled, wanted = imgui.checkbox(f"{tr(label)}###{label}", on)
    workspace.remember(label)
    tooltip(tip)
    if toggled:
        workspace.editor.edit(label, lambda project: change(project, wanted))


def name_field(workspace: Workspace, key: str, name: str, rename: Callable[[str], object]) -> None:
    """Draws an editable name; ``rename`` is called with a changed name."""
    imgui.set_next_item_width(-1)
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    typed, wanted = imgui.input_text(f"##{key}", name, flags)
    workspace.remember(key)
    if typed and wanted.strip() and wanted.strip() != name:
        rename(wanted.strip())


def character_name(workspace: Workspace, character: RigBase) -> None:
    """Draws the field of a character's name. Renaming keeps the selection."""
    editor, before = workspace.editor, workspace.editor.selection

    def rename(wanted: str) -> None:
        if editor.edit("rename", lambda project: rename_character(project, character.id, wanted)):
            editor.select(character=wanted)
            editor.select(handle=before.handle, layer=before.layer)

    name_field(workspace, "name", character.id, rename)
