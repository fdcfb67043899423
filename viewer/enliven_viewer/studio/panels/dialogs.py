"""Dialogues: files, unsaved work, recovery, and the list of keys."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from enliven.errors import EnlivenError
from enliven_viewer.studio.panels.menu import spoken
from enliven_viewer.studio.panels.style import quiet, tinted
from enliven_viewer.studio.tools import TOOLS
from enliven_viewer.studio.workspace import MENU_COMMANDS, FileBrowser, Workspace
from enliven_viewer.theme import WAIT

_FOLDER = "\uf07b"
_TITLES = {
    "open": "Open",
    "save as": "Save the project",
    "export": "Export GLB",
    "perform": "Play a recording on the stage",
    "session": "Save the examples",
}


def draw_dialogs(workspace: Workspace) -> None:
    """Draw the open dialogue over everything."""
    if workspace.asking in _TITLES:
        _files(workspace)
    elif workspace.asking == "help":
        _help(workspace)
    elif workspace.asking == "recover":
        _recover(workspace)
    elif workspace.asking:
        _unsaved(workspace)


def _begin(title: str, wide: float, high: float = 0.0) -> bool:
    imgui.open_popup(title)
    middle = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(middle, imgui.Cond_.always, ImVec2(0.5, 0.5))
    imgui.set_next_window_size(ImVec2(wide, high))
    flags = imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_saved_settings
    return bool(imgui.begin_popup_modal(title, None, flags)[0])


def _files(workspace: Workspace) -> None:
    browser = workspace.browser
    if browser is None or not _begin(_TITLES[workspace.asking], 560, 440):
        return
    if imgui.button("Up"):
        browser.enter(browser.folder.parent)
    imgui.same_line()
    imgui.text_unformatted(str(browser.folder))
    imgui.begin_child("##list", ImVec2(0, 270), imgui.ChildFlags_.frame_style)
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
    imgui.set_next_item_width(-1)
    typed, name = imgui.input_text("##name", browser.name, imgui.InputTextFlags_.enter_returns_true)
    browser.name = name
    with tinted(WAIT, imgui.Col_.text):
        imgui.text_unformatted(browser.said)
    if _choice(workspace, "Save" if browser.saving else "Open", "Cancel") or typed or done:
        _finish(workspace, browser)
    imgui.end_popup()


def _finish(workspace: Workspace, browser: FileBrowser) -> None:
    """Finish the file dialogue; it shows an error where the choice cannot be used."""
    try:
        path = browser.chosen()
    except EnlivenError as error:
        browser.said = f"{error.what}. {error.mend}"
        return
    workspace.attempt(lambda: workspace.chosen(path))


def _choice(workspace: Workspace, yes: str, no: str) -> bool:
    """Two buttons; whether the first was pressed. The second, and Escape, close the dialogue."""
    pressed = imgui.button(yes, ImVec2(110, 0))
    workspace.remember(f"dialog {yes}")
    imgui.same_line()
    if imgui.button(no, ImVec2(110, 0)) or imgui.is_key_pressed(imgui.Key.escape):
        workspace.cancel()
    workspace.remember(f"dialog {no}")
    return bool(pressed)


def _unsaved(workspace: Workspace) -> None:
    """Ask before work is thrown away."""
    if not _begin("Save your work?", 430):
        return
    name = workspace.store.name
    imgui.text_wrapped(f"{name} has changes that are not saved. They are lost unless you save them.")
    imgui.dummy(ImVec2(0, 6))
    if _choice(workspace, "Save", "Cancel"):
        workspace.go_on(discard=False)
    imgui.same_line(0.0, 40.0)
    if imgui.button("Discard", ImVec2(110, 0)):
        workspace.go_on(discard=True)
    workspace.remember("dialog Discard")
    imgui.end_popup()


def _recover(workspace: Workspace) -> None:
    """Offer the unsaved work of a studio that crashed."""
    found = workspace.store.recoverable()
    if not found or not _begin("Unsaved work was found", 460):
        workspace.asking = workspace.asking if found else ""
        return
    imgui.text_wrapped(
        f"The studio ended without saving. Its last work, of {_when(found[0])}, is still there."
    )
    imgui.dummy(ImVec2(0, 6))
    if imgui.button("Recover", ImVec2(110, 0)):
        workspace.asking = ""
        workspace.attempt(lambda: workspace.store.recover(found[0]))
    workspace.remember("dialog Recover")
    imgui.same_line()
    if imgui.button("Throw away", ImVec2(110, 0)):
        workspace.asking = ""
        workspace.store.discard(found)
    imgui.same_line()
    if imgui.button("Later", ImVec2(110, 0)):
        workspace.asking = ""
    imgui.end_popup()


def _when(path: Path) -> str:
    import datetime

    return datetime.datetime.fromtimestamp(path.stat().st_mtime).strftime("%d %B, %H:%M")


def _help(workspace: Workspace) -> None:
    if not _begin("Keys", 970, 560):
        return
    rows = [("Tools", [(kind.key.upper(), kind.label) for kind in TOOLS])]
    for menu in dict.fromkeys(command.menu for command in MENU_COMMANDS):
        rows.append(
            (menu, [(spoken(d.keys[0]), d.label) for d in MENU_COMMANDS if d.menu == menu and d.keys])
        )
    rows.append(("Mouse", [("Right drag", "turn the view"), ("Middle drag", "move it"), ("Wheel", "closer")]))
    rows.append(("Anywhere", [("Esc", "drop what was begun")]))
    imgui.columns(3, "##keys", False)
    each = -(-sum(len(lines) + 1 for _, lines in rows) // 3)
    done = 0
    for title, lines in rows:
        if done and done + len(lines) > each + 2:
            imgui.next_column()
            done = 0
        quiet(title.upper())
        for key, label in lines:
            imgui.text_unformatted(key)
            imgui.same_line(118)
            imgui.text_disabled(label)
        done += len(lines) + 1
    imgui.columns(1)
    imgui.set_cursor_pos_y(560 - 42)
    if imgui.button("Close", ImVec2(110, 0)) or imgui.is_key_pressed(imgui.Key.escape):
        workspace.asking = ""
    imgui.end_popup()
