"""The preferences: text size, animation, theme, language, and shortcuts."""

from __future__ import annotations

from collections.abc import Mapping

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import LANGUAGES, Texts, tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.actions.imgui_keys import KEYS, find_held_modifiers
from enliven_viewer.studio.actions.keys import format_key
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.style import draw_note, push_colours
from enliven_viewer.studio.panels.modal import draw_button, open_modal
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import WAIT

_DIALOG_SIZE = (620.0, 520.0)
"""Size of the dialogue in pixels. It fits fifteen rows with action, shortcut and button."""
_KEY_WIDTH = 150.0
"""Width in pixels of a shortcut's button. It fits Ctrl+Shift+PgDn."""
_THEME_WIDTH = 130.0
"""Width in pixels of the theme field. It fits the longest theme name."""
_THEME_LABELS = Texts({"dark": "Dark", "light": "Light"})
_PALETTE_LABELS = Texts({"usual": "Standard", "okabe-ito": "For colour-blind people (Okabe-Ito)"})
"""Names of the palettes; the second also suits people with red-green colour blindness."""
_REMOVE_WIDTH = 42.0
"""Width in pixels of the button that removes the shortcut."""


def draw_preferences(workspace: Workspace) -> None:
    """Draws the dialogue while it is open."""
    with open_modal("Preferences", *_DIALOG_SIZE) as shown:
        if not shown:
            return
        _draw_reading_options(workspace)
        asking = bool(workspace.wanted_key.action)
        imgui.begin_child("##keys", ImVec2(0, -3 * imgui.get_frame_height() - 18))
        for menu, actions in workspace.actions.menus.items():
            draw_note(tr(menu).upper())
            for action in actions:
                _draw_row(workspace, action)
        imgui.end_child()
        _handle_capture(workspace)
        if draw_button(workspace, "Close") or (imgui.is_key_pressed(imgui.Key.escape) and not asking):
            workspace.cancel()
        imgui.same_line()
        imgui.begin_disabled(not workspace.actions.has_custom_shortcuts)
        if imgui.button(f"{tr('Reset all shortcuts')}###usual"):
            workspace.actions.reset_shortcuts()
        workspace.remember("usual keys")
        imgui.end_disabled()


def _draw_reading_options(workspace: Workspace) -> None:
    """Draws the text size, animation, theme, palette and language."""
    preferences, actions = workspace.preferences, workspace.actions
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(tr("Size of text"))
    imgui.same_line(110)
    for sign, action in (("-", "view.smaller_text"), ("+", "view.larger_text")):
        imgui.begin_disabled(bool(actions[action].why_not()))
        if imgui.button(f"{sign}###{action}", ImVec2(32, 0)):
            actions.do(action)
        imgui.end_disabled()
        workspace.remember(action)
        imgui.same_line()
    imgui.text_unformatted(f"{preferences.text_size:.0%}")
    imgui.same_line(260)
    if imgui.checkbox(f"{tr('Less motion')}###calm", preferences.less_motion)[0]:
        actions.do("view.less_motion")
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(tr("Theme"))
    imgui.same_line(110)
    theme = _draw_choice(workspace, "theme", _THEME_LABELS, preferences.theme, _THEME_WIDTH)
    imgui.same_line(260)
    imgui.text_unformatted(tr("Colours"))
    imgui.same_line()
    colours = _draw_choice(workspace, "colours", _PALETTE_LABELS, preferences.colours, -1.0)
    draw_tooltip("Colours of limbs, performers, takes and control points")
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(tr("Language"))
    imgui.same_line(110)
    language = _draw_choice(workspace, "language", LANGUAGES, preferences.language, 170.0)
    if language != preferences.language:
        preferences.set_language(language)
    if (theme, colours) != (preferences.theme, preferences.colours):
        preferences.set_colours(theme, colours)
    imgui.separator()


def _draw_choice(
    workspace: Workspace, name: str, labels: Mapping[str, str], current: str, width: float
) -> str:
    """Draws a list of options. Returns the key of the selected one."""
    imgui.set_next_item_width(width)
    opened = imgui.begin_combo(f"##{name}", labels[current])
    workspace.remember(name)
    if opened:
        for key, label in labels.items():
            if imgui.selectable(f"{label}###{name} {key}", key == current)[0]:
                current = key
            workspace.remember(f"{name} {key}")
        imgui.end_combo()
    return current


def _draw_row(workspace: Workspace, action: Action) -> None:
    """Draws an action with the buttons that change its shortcut."""
    wanted_key, key = workspace.wanted_key, workspace.actions.format_shortcut(action)
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(tr(action.label))
    imgui.same_line(imgui.get_content_region_avail().x - _KEY_WIDTH - _REMOVE_WIDTH)
    key_text = tr("Press a key ...") if wanted_key.action == action.id else key or tr("none")
    if imgui.button(f"{key_text}###key {action.id}", ImVec2(_KEY_WIDTH, 0)):
        wanted_key.begin(action.id)
    workspace.remember(f"key {action.id}")
    imgui.same_line()
    imgui.begin_disabled(not key)
    if imgui.button(f"\uf00d##no {action.id}"):
        workspace.actions.clear_shortcuts(action.id)
    imgui.end_disabled()


def _make_reassign_label(action: Action) -> str:
    """Returns the label of the button that reassigns a shortcut to an action."""
    return tr("Use the key for “{0}”", tr(action.label))


def _handle_capture(workspace: Workspace) -> None:
    """Assigns the pressed key. If it is another action's shortcut, names that action and asks for
    confirmation.
    """
    wanted_key, actions = workspace.wanted_key, workspace.actions
    if wanted_key.action and not wanted_key.key:
        for name, key in KEYS.items():
            if imgui.is_key_pressed(key, repeat=False):
                wanted_key.press(actions, find_held_modifiers() + name)
    other = actions.find_conflict(wanted_key.action, wanted_key.key) if wanted_key.key else None
    if other is None:
        draw_note("Click a shortcut to change it. Keys in the hint of the active tool belong to the tool.")
        imgui.dummy(ImVec2(0, imgui.get_frame_height() - 8))
        return
    with push_colours(WAIT, imgui.Col_.text):
        imgui.text_unformatted(
            tr("{0} is already the shortcut of \u201c{1}\u201d.", format_key(wanted_key.key), tr(other.label))
        )
    if imgui.button(f"{_make_reassign_label(actions[wanted_key.action])}###take"):
        wanted_key.assign_key(actions)
    workspace.remember("take the key")
    imgui.same_line()
    if imgui.button(f"{tr('Keep it')}###leave"):
        wanted_key.begin("")
