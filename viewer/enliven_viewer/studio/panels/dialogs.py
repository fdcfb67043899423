"""Dialogues: files, unsaved work, recovery, and those that other modules draw."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from enliven.errors import EnlivenError
from enliven_viewer.studio.panels.history import draw_history
from enliven_viewer.studio.panels.key_list import draw_key_list
from enliven_viewer.studio.panels.modal import button, choice, modal
from enliven_viewer.studio.panels.palette import draw_palette
from enliven_viewer.studio.panels.preferences import draw_preferences
from enliven_viewer.studio.panels.saving import draw_changed_file, draw_unsaved
from enliven_viewer.studio.panels.style import quiet, tinted
from enliven_viewer.studio.workspace import FileBrowser, Workspace
from enliven_viewer.theme import WAIT

_FOLDER = "\uf07b"
_TITLES = {
    "open": "Open",
    "save as": "Save the project",
    "export": "Export",
    "film": "Write a film",
    "perform": "Play a recording on the stage",
    "session": "Save the examples",
}


def draw_dialogs(workspace: Workspace) -> None:
    """Draw the open dialogue over everything."""
    if workspace.history_shown:
        draw_history(workspace)
    if workspace.asking in _TITLES:
        _files(workspace)
    elif workspace.asking in _DIALOGUES:
        _DIALOGUES[workspace.asking](workspace)


def _files(workspace: Workspace) -> None:
    browser = workspace.browser
    if browser is None:
        return
    with modal(_TITLES[workspace.asking], 560, 440) as shown:
        if shown:
            _browse(workspace, browser)


def _browse(workspace: Workspace, browser: FileBrowser) -> None:
    if imgui.button("Up"):
        browser.enter(browser.folder.parent)
    imgui.same_line()
    imgui.text_unformatted(str(browser.folder))
    rows = 3 * imgui.get_frame_height_with_spacing()
    imgui.begin_child("##list", ImVec2(0, -rows), imgui.ChildFlags_.frame_style)
    done = False
    for folder in browser.folders():
        if imgui.selectable(f"{_FOLDER}  {folder.name}", False)[0]:
            browser.enter(folder)
    for file in browser.files():
        flags = imgui.SelectableFlags_.allow_double_click
        if imgui.selectable(file.name, browser.name == file.name, flags)[0]:
            browser.name = file.name
            done = imgui.is_mouse_double_clicked(0)
        workspace.remember(f"file {file.name}")
    if browser.problem:
        quiet(browser.problem)
    imgui.end_child()
    if imgui.is_window_appearing() or browser.again:
        browser.again = False
        imgui.set_keyboard_focus_here()
    imgui.set_next_item_width(-1)
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    typed, browser.name = imgui.input_text("##name", browser.name, flags)
    workspace.remember("file name")
    with tinted(WAIT, imgui.Col_.text):
        imgui.text_unformatted(browser.said)
    if choice(workspace, "Save" if browser.saving else "Open", "Cancel") or typed or done:
        _finish(workspace, browser)


def _finish(workspace: Workspace, browser: FileBrowser) -> None:
    """Finish the file dialogue; it shows an error where the choice cannot be used."""
    try:
        path = browser.chosen()
    except EnlivenError as error:
        browser.said, browser.again = f"{error.what}. {error.mend}", True
        return
    workspace.attempt(lambda: workspace.chosen(path))


def _recover(workspace: Workspace) -> None:
    """Offer the unsaved work of a studio that crashed."""
    found = workspace.store.recoverable()
    if not found:
        workspace.asking = ""
        return
    with modal("Unsaved work was found", 460) as shown:
        if not shown:
            return
        imgui.text_wrapped(
            f"The studio ended without saving. Its last work, of {_when(found[0])}, is still there."
        )
        imgui.dummy(ImVec2(0, 6))
        if button(workspace, "Recover"):
            workspace.asking = ""
            workspace.attempt(lambda: workspace.store.recover(found[0]))
        imgui.same_line()
        if button(workspace, "Throw away"):
            workspace.asking = ""
            workspace.store.discard(found)
        imgui.same_line()
        if button(workspace, "Later"):
            workspace.asking = ""


def _when(path: Path) -> str:
    import datetime

    return datetime.datetime.fromtimestamp(path.stat().st_mtime).strftime("%d %B, %H:%M")


_DIALOGUES = {
    "unsaved": draw_unsaved,
    "changed": draw_changed_file,
    "recover": _recover,
    "help": draw_key_list,
    "palette": draw_palette,
    "preferences": draw_preferences,
}
"""What draws each dialogue that is not about files."""
