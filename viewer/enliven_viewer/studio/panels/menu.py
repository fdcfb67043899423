"""The menu bar: every command in its menu, with its keys."""

from __future__ import annotations

from imgui_bundle import imgui

from enliven_viewer.studio.workspace import MENU_COMMANDS, Workspace

_SAID = {
    "ctrl": "Ctrl",
    "shift": "Shift",
    "delete": "Del",
    "space": "Space",
    "left": "Left",
    "right": "Right",
}


def draw_menu(workspace: Workspace) -> None:
    """Draw the bar along the top."""
    if not imgui.begin_main_menu_bar():
        return
    for menu in dict.fromkeys(command.menu for command in MENU_COMMANDS):
        opened = imgui.begin_menu(menu)
        workspace.remember(f"menu {menu}")
        if opened:
            for command in (command for command in MENU_COMMANDS if command.menu == menu):
                keys = spoken(command.keys[0]) if command.keys else ""
                if imgui.menu_item(command.label, keys, False, True)[0]:
                    command.do(workspace.input.commands)
                workspace.remember(f"menu {menu}/{command.label}")
            imgui.end_menu()
    imgui.end_main_menu_bar()


def spoken(key: str) -> str:
    """A key as people read it: "ctrl+shift+z" is Ctrl+Shift+Z."""
    return "+".join(
        _SAID.get(part, part.upper() if len(part) == 1 else part.title()) for part in key.split("+")
    )
