"""The ImGui key codes by key name, and the pressed modifier keys."""

from __future__ import annotations

from imgui_bundle import imgui

from enliven_viewer.studio.actions.keys import MODIFIERS

_SAME_NAME_KEYS = (
    "space",
    "home",
    "end",
    "delete",
    "backspace",
    "escape",
    "enter",
    "equal",
    "minus",
    "tab",
    "insert",
)
_MORE_KEYS = (
    "page_up",
    "page_down",
    "comma",
    "period",
    "slash",
    "semicolon",
    "left_bracket",
    "right_bracket",
)
KEYS = {
    **{letter: getattr(imgui.Key, letter) for letter in "abcdefghijklmnopqrstuvwxyz"},
    **{str(k): getattr(imgui.Key, f"_{k}") for k in range(10)},
    **{f"f{k}": getattr(imgui.Key, f"f{k}") for k in range(1, 13)},
    **{way: getattr(imgui.Key, f"{way}_arrow") for way in ("left", "right", "up", "down")},
    **{name: getattr(imgui.Key, name) for name in (*_SAME_NAME_KEYS, *_MORE_KEYS)},
}
"""Every key that a shortcut can use, by its name in files and scripted sessions."""


def find_held_modifiers() -> str:
    """Returns the currently pressed modifiers as a shortcut prefix, such as "ctrl+shift+", or empty."""
    io = imgui.get_io()
    held = (io.key_ctrl, io.key_shift, io.key_alt)
    return "".join(f"{name}+" for name, down in zip(MODIFIERS, held, strict=True) if down)
