"""Draws the dialogues for files and recovery, and calls the modules that draw other dialogues."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from enliven.errors import EnlivenError
from enliven_viewer.language import tr
from enliven_viewer.studio.app.file_browser import ORDER_LABELS, FileBrowser, list_places
from enliven_viewer.studio.app.style import draw_note, push_colours
from enliven_viewer.studio.panels.export_options import draw_export_options
from enliven_viewer.studio.panels.history import draw_history
from enliven_viewer.studio.panels.key_list import draw_key_list
from enliven_viewer.studio.panels.modal import draw_button, draw_choice, open_modal
from enliven_viewer.studio.panels.palette import draw_palette
from enliven_viewer.studio.panels.preferences import draw_preferences
from enliven_viewer.studio.panels.saving import draw_changed_file, draw_unsaved
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import WAIT

_FOLDER_ICON = "\uf07b"
_DIALOG_SIZE = (720.0, 480.0)
"""Size in pixels of a file dialogue with bookmarked folders at the left and files in the middle."""
_MIN_WIDTH_WITH_PLACES = 480.0
"""Minimum width in pixels of a dialogue that shows bookmarked folders at the left."""
_PLACES_WIDTH = 150.0
"""Width in pixels of the list of bookmarked folders."""
_ORDER_WIDTH = 120.0
"""Width in pixels of the sort order field. It fits the longest label."""
_CANCEL_WIDTH = 84.0
"""Space in pixels to the right of the new folder's name, for the Cancel button."""
_TITLES = {
    "open": "Open",
    "save as": "Save the project",
    "export": "Export",
    "film": "Write a film",
    "session": "Save the examples",
}


def draw_dialogs(workspace: Workspace) -> None:
    """Draws the open dialogue on top of everything."""
    if workspace.history_shown:
        draw_history(workspace)
    titles = {name: dialog.title for name, dialog in workspace.file_dialogs.items()} | _TITLES
    if workspace.asking in titles:
        _draw_file_dialog(workspace, titles[workspace.asking])
    elif workspace.asking in _DRAW_FUNCTIONS:
        _DRAW_FUNCTIONS[workspace.asking](workspace)


def _draw_file_dialog(workspace: Workspace, title: str) -> None:
    browser = workspace.browser
    if browser is None:
        return
    with open_modal(title, *_DIALOG_SIZE) as shown:
        if shown:
            _draw_browser(workspace, browser)


def _draw_browser(workspace: Workspace, browser: FileBrowser) -> None:
    if workspace.asking in ("export", "film"):
        draw_export_options(workspace, film=workspace.asking == "film")
    _draw_browser_head(workspace, browser)
    rows = 3 * imgui.get_frame_height_with_spacing()
    if imgui.get_content_region_avail().x > _MIN_WIDTH_WITH_PLACES:
        _draw_places(workspace, browser, rows)
        imgui.same_line()
    imgui.begin_child("##list", ImVec2(0, -rows), imgui.ChildFlags_.frame_style)
    is_done = False
    for folder in browser.folders():
        if imgui.selectable(f"{_FOLDER_ICON}  {folder.name}##folder", False)[0]:
            browser.enter(folder)
        workspace.remember(f"folder {folder.name}")
    for file in browser.files():
        flags = imgui.SelectableFlags_.allow_double_click
        if imgui.selectable(file.name, browser.name == file.name, flags)[0]:
            browser.name = file.name
            is_done = imgui.is_mouse_double_clicked(0)
        workspace.remember(f"file {file.name}")
    if browser.problem:
        draw_note(browser.problem)
    imgui.end_child()
    if (imgui.is_window_appearing() or browser.awaits_retry) and browser.new_folder_name is None:
        browser.awaits_retry = False
        imgui.set_keyboard_focus_here()
    imgui.set_next_item_width(-1)
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    typed, browser.name = imgui.input_text("##name", browser.name, flags)
    workspace.remember("file name")
    with push_colours(WAIT, imgui.Col_.text):
        imgui.text_unformatted(browser.refusal)
    if draw_choice(workspace, "Save" if browser.saving else "Open", "Cancel") or typed or is_done:
        _finish(workspace, browser)


def _draw_browser_head(workspace: Workspace, browser: FileBrowser) -> None:
    """Draws the folder, the sort order, and the field of a new folder."""
    if imgui.button(f"{tr('Up')}###up"):
        browser.enter(browser.folder.parent)
    workspace.remember("folder up")
    imgui.same_line()
    imgui.set_next_item_width(_ORDER_WIDTH)
    opened = imgui.begin_combo("##order", tr(ORDER_LABELS[browser.order]))
    workspace.remember("order")
    if opened:
        for order, label in ORDER_LABELS.items():
            if imgui.selectable(label, order == browser.order)[0]:
                browser.order = order
            workspace.remember(f"order {order}")
        imgui.end_combo()
    imgui.same_line()
    if browser.new_folder_name is None:
        if imgui.button(f"{tr('New folder')}###new folder"):
            browser.new_folder_name = ""
        workspace.remember("new folder")
        imgui.same_line()
        imgui.text_unformatted(_shorten_path(str(browser.folder), imgui.get_content_region_avail().x))
        return
    imgui.set_keyboard_focus_here()
    imgui.set_next_item_width(-_CANCEL_WIDTH)
    is_entered, browser.new_folder_name = imgui.input_text_with_hint(
        "##new folder",
        tr("Type the name of the new folder, then press Enter"),
        browser.new_folder_name,
        imgui.InputTextFlags_.enter_returns_true,
    )
    workspace.remember("new folder name")
    imgui.same_line()
    if imgui.button(f"{tr('Not now')}###not now"):
        browser.new_folder_name = None
    elif is_entered:
        try:
            browser.make_folder()
            browser.refusal = ""
        except EnlivenError as error:
            browser.refusal = f"{error.what[:1].upper()}{error.what[1:]}. {error.remedy}"


def _draw_places(workspace: Workspace, browser: FileBrowser, rows: float) -> None:
    """Draws the user's own folders, removable drives, and folders of recent files."""
    imgui.begin_child("##places", ImVec2(_PLACES_WIDTH, -rows), imgui.ChildFlags_.frame_style)
    for number, (name, folder) in enumerate(list_places(workspace.preferences.recent, Path.cwd())):
        if imgui.selectable(f"{name}##place {number}", folder == browser.folder)[0]:
            browser.enter(folder)
        workspace.remember(f"place {name}")
        imgui.set_item_tooltip(str(folder))
    imgui.end_child()


def _shorten_path(text: str, max_width: float) -> str:
    """Returns a path shortened at its start to fit the width."""
    if imgui.calc_text_size(text).x <= max_width:
        return text
    while len(text) > 1 and imgui.calc_text_size(f"\u2026{text}").x > max_width:
        text = text[1:]
    return f"\u2026{text}"


def _finish(workspace: Workspace, browser: FileBrowser) -> None:
    """Finishes the file dialogue, or shows an error if the choice cannot be used."""
    try:
        path = browser.get_path()
    except EnlivenError as error:
        browser.refusal, browser.awaits_retry = f"{error.what}. {error.remedy}", True
        return
    workspace.run_and_report(lambda: workspace.finish_file_dialog(path))


def _draw_recovery(workspace: Workspace) -> None:
    """Offers to recover the unsaved work of a crashed studio."""
    recovery_files = workspace.store.list_recoverable()
    if not recovery_files:
        workspace.asking = ""
        return
    with open_modal("Unsaved work was found", 460) as shown:
        if not shown:
            return
        imgui.text_wrapped(
            tr(
                "The studio ended without saving. Your work from {0} can be recovered.",
                _format_change_time(recovery_files[0]),
            )
        )
        imgui.dummy(ImVec2(0, 6))
        if draw_button(workspace, "Recover"):
            workspace.asking = ""
            workspace.run_and_report(lambda: workspace.store.recover(recovery_files[0]))
        imgui.same_line()
        if draw_button(workspace, "Discard"):
            workspace.asking = ""
            workspace.store.discard(recovery_files)
        imgui.same_line()
        if draw_button(workspace, "Later"):
            workspace.asking = ""


def _format_change_time(path: Path) -> str:
    import datetime

    return datetime.datetime.fromtimestamp(path.stat().st_mtime).strftime("%d %B, %H:%M")


_DRAW_FUNCTIONS = {
    "unsaved": draw_unsaved,
    "changed": draw_changed_file,
    "recover": _draw_recovery,
    "help": draw_key_list,
    "palette": draw_palette,
    "preferences": draw_preferences,
}
"""The drawing function of each dialogue that is not about files."""
