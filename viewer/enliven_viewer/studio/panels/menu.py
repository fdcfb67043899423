"""The menu bar: every action in its menu, with its shortcut, and the tabs of the workspaces."""

from __future__ import annotations

import itertools
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.app.fields import draw_action_tooltip, draw_tooltip
from enliven_viewer.studio.app.style import pack_colour
from enliven_viewer.studio.app.workspace_tabs import WORKSPACES
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import ACCENT, BAD, INK

_TAB_TIPS = {
    "Perform": "Step into characters and record what you do",
    "Animate": "Animate characters: map, shift, mix and correct motion",
    "Model": "Sketch, cut and merge characters, with more room for the picture",
    "Play": "Shows only the picture",
}
_TAB_WIDTH = 84.0
"""Width of a tab in pixels. It fits the longest name with margins."""
_NARROW_TAB_WIDTH = 64.0
"""Width in pixels of a tab in a narrow window. It fits the longest name and the recording dot."""
_MIN_GAP = 12.0
"""Minimum gap in pixels between the menus and the first tab."""


def measure_tabs(*, narrow: bool = False) -> float:
    """Returns the width in pixels of all tabs, including the gap before them."""
    return _MIN_GAP + (_NARROW_TAB_WIDTH if narrow else _TAB_WIDTH) * len(WORKSPACES)


def draw_workspace_tabs(workspace: Workspace) -> None:
    """Draws one tab per workspace in the middle of the menu bar.

    The Perform tab has a dot during a recording.
    """
    if not imgui.begin_main_menu_bar():
        return
    tabs = workspace.tabs
    begin, width = imgui.get_cursor_pos_x() + _MIN_GAP, imgui.get_window_width()
    tab = min(max((width - begin) / len(WORKSPACES), _NARROW_TAB_WIDTH), _TAB_WIDTH)
    left = min(max((width - tab * len(WORKSPACES)) / 2, begin), width - tab * len(WORKSPACES))
    draw_list, height = imgui.get_window_draw_list(), imgui.get_window_height()
    for number, workspace_name in enumerate(WORKSPACES):
        x = left + number * tab
        if tabs.active == workspace_name:
            draw_list.add_rect_filled(ImVec2(x, 1), ImVec2(x + tab, height), pack_colour(ACCENT, 0.22), 6.0)
        imgui.set_cursor_pos_x(x)
        imgui.set_cursor_pos_y(0)
        if imgui.invisible_button(f"##room {workspace_name}", ImVec2(tab, height)):
            tabs.active = workspace_name
        draw_tooltip(tr("{0}  (Ctrl+{1})", tr(_TAB_TIPS[workspace_name]), number + 1))
        is_bright = tabs.active == workspace_name or imgui.is_item_hovered()
        workspace.remember(f"room {workspace_name}")
        letters = imgui.calc_text_size(tr(workspace_name)).x
        text_offset = ImVec2(x + (tab - letters) / 2, (height - imgui.get_text_line_height()) / 2)
        draw_list.add_text(text_offset, pack_colour(ACCENT if is_bright else INK), tr(workspace_name))
        if workspace_name == "Perform" and workspace.store.records:
            draw_list.add_circle_filled(ImVec2(text_offset.x - 9, height / 2), 4.0, pack_colour(BAD))
    imgui.end_main_menu_bar()


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
    actions, is_on = workspace.actions, action.is_on is not None and action.is_on()
    key, possible = actions.format_shortcut(action), not action.why_not()
    if imgui.menu_item(f"{tr(action.entry)}###{action.entry}", key, is_on, possible)[0]:
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
            workspace.run_and_report(lambda path=path: workspace.open(path))
        workspace.remember(f"recent {path.name}")
        imgui.set_item_tooltip(str(path.parent))
    imgui.end_menu()
