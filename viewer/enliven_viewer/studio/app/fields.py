"""Panel widgets that edit the project, such as sliders, checkboxes and name fields, and buttons
of actions.
"""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from enliven.document import Project, RigBase
from enliven.modeling.edits import rename_character
from enliven_viewer.language import later, tr
from enliven_viewer.studio.app.app import App

Change = Callable[[Project, float], Project]
"""An edit that applies a number."""


def draw_tooltip(text: str) -> None:
    """Shows the tooltip of the last widget while the pointer rests on it."""
    if text and imgui.is_item_hovered():
        imgui.set_tooltip(tr(text))


def draw_slider(
    app: App, name: str, value: float, low: float, high: float, number_format: str, change: Change
) -> None:
    """Draws a slider. A drag shows a draft of the project, and its end adds one edit to the history. Integer
    bounds make it an integer slider.
    """
    imgui.set_next_item_width(-1)
    if isinstance(low, int):
        changed, new_value = imgui.slider_int(f"##{name}", int(value), low, int(high), tr(number_format))
    else:
        # Use a logarithmic scale for a range over several powers of ten.
        flags = imgui.SliderFlags_.logarithmic if low > 0.0 and high / low > 1e3 else 0
        changed, new_value = imgui.slider_float(f"##{name}", value, low, high, tr(number_format), flags)
    app.remember(name)
    if changed:
        app.editor.preview_edit(lambda project: change(project, new_value))
    if imgui.is_item_deactivated_after_edit():
        last = new_value if changed else value
        app.editor.edit(later("change {0}", later(name.partition(" ")[2] or name)), lambda p: change(p, last))


def draw_switch(app: App, label: str, on: bool, change: Change, tip: str = "") -> None:
    """Draws a checkbox. A click makes one edit."""
    toggled, is_on = imgui.checkbox(f"{tr(label)}###{label}", on)
    app.remember(label)
    draw_tooltip(tip)
    if toggled:
        app.editor.edit(label, lambda project: change(project, is_on))


def draw_name_field(app: App, key: str, name: str, rename: Callable[[str], object]) -> None:
    """Draws an editable name. ``rename`` is called with a changed name."""
    imgui.set_next_item_width(-1)
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    typed, new_name = imgui.input_text(f"##{key}", name, flags)
    app.remember(key)
    if typed and new_name.strip() and new_name.strip() != name:
        rename(new_name.strip())


def draw_character_name(app: App, character: RigBase) -> None:
    """Draws the field of a character's name. Renaming keeps the selection."""
    editor, old_selection = app.editor, app.editor.selection

    def rename(wanted: str) -> None:
        if editor.edit("rename", lambda project: rename_character(project, character.id, wanted)):
            editor.select(character=wanted)
            editor.select(handle=old_selection.handle, layer=old_selection.layer)

    draw_name_field(app, "name", character.id, rename)


def draw_action_button(app: App, action_id: str, width: float = 0.0) -> None:
    """Draws a button that runs an action.

    If the action is unavailable, the button is grey and its tooltip shows the reason.

    Args:
        width: width in pixels; 0 fits the label.
    """
    action = app.actions[action_id]
    imgui.begin_disabled(bool(action.why_not()))
    if imgui.button(f"{tr(action.label)}###{action.id}", ImVec2(width, 0)):
        app.actions.do(action_id)
    imgui.end_disabled()
    app.remember(f"do {action.label}")
    draw_action_tooltip(app, action_id)


def draw_action_tooltip(app: App, action_id: str) -> None:
    """Shows the tooltip of an action on the last widget, even if the widget is disabled."""
    flags = imgui.HoveredFlags_.for_tooltip | imgui.HoveredFlags_.allow_when_disabled
    if imgui.is_item_hovered(flags):
        imgui.set_tooltip(app.actions.make_tooltip(app.actions[action_id]))
