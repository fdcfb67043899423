"""The menu bar: every action in its menu, with its shortcut."""

from __future__ import annotations

import itertools
from pathlib import Path

from imgui_bundle import imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.app.fields import draw_action_tooltip
from enliven_viewer.studio.panels.stage.workspace_tabs import measure_tabs
from enliven_viewer.studio.workspace.workspace import Workspace

_MENU_ICON = "\uf0c9"
"""Icon with three lines: the menu that contains all others in a narrow window."""


def draw_menu(workspace: Workspace) -> None:
    """Draws the menu bar along the top."""
    if not imgui.begin_main_menu_bar():
        return
    names = list(workspace.actions.menus)
    names_width = sum(imgui.calc_text_size(tr(name)).x for name in names)
    # Add the item spacing twice for each name, because ImGui adds it on both sides.
    needed = names_width + 2 * len(names) * imgui.get_style().item_spacing.x
    available_width = imgui.get_window_width() - measure_tabs(narrow=True)
    if needed <= available_width:
        _draw_menus(workspace)
    else:
        # The window is too narrow for the menu bar. Show one menu with all of the menus, so that the
        # workspace tabs stay visible.
        opened = imgui.begin_menu(f"{_MENU_ICON}  {tr('Menu')}###all")
        workspace.remember("menu all")
        if opened:
            _draw_menus(workspace)
            imgui.end_menu()
    imgui.end_main_menu_bar()


def _draw_menus(workspace: Workspace) -> None:
    """Draws each menu with its actions."""
    for menu, actions in workspace.actions.menus.items():
        opened = imgui.begin_menu(f"{tr(menu)}###{menu}")
        workspace.remember(f"menu {menu}")
        if opened:
            for number, (group, entries) in enumerate(
                itertools.groupby(actions, lambda action: action.group)
            ):
                _draw_entries(workspace, group, list(entries), first=not number)
            imgui.end_menu()


def _draw_entries(workspace: Workspace, group: str, actions: list[Action], *, first: bool) -> None:
    """Draws the entries of one group, in a submenu if the group has a name."""
    if actions[0].apart and not first:
        imgui.separator()
    if group and not imgui.begin_menu(f"{tr(group)}###{group}"):
        return
    for number, action in enumerate(actions):
        if action.apart and number:
            imgui.separator()
        _draw_entry(workspace, action)
        if action.id == "file.open":
            _draw_recent_files(workspace)
    if group:
        imgui.end_menu()


def _draw_entry(workspace: Workspace, action: Action) -> None:
    """Draws one menu entry. It is grey if the action is unavailable."""
    actions, on = workspace.actions, action.is_on is not None and action.is_on()
    key, possible = actions.format_shortcut(action), not action.why_not()
    if imgui.menu_item(f"{tr(action.entry)}###{action.entry}", key, on, possible)[0]:
        actions.do(action.id)
    workspace.remember(f"menu {action.place}")
    draw_action_tooltip(workspace, action.id)


def _draw_recent_files(workspace: Workspace) -> None:
    """Draws the recently opened or saved files. The tooltip shows the folder."""
    paths = [Path(name) for name in workspace.preferences.recent]
    if not imgui.begin_menu(f"{tr('Open recent')}###Open recent", bool(paths)):
        return
    for number, path in enumerate(paths):
        if imgui.menu_item(f"{path.name}###recent {number}", "", False, True)[0]:
            workspace.attempt(lambda path=path: workspace.open(path))
        workspace.remember(f"recent {path.name}")
        imgui.set_item_tooltip(str(path.parent))
    imgui.end_menu()
