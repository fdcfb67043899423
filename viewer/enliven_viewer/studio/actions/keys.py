"""Names of keys, such as "ctrl+shift+z": as they are saved, and as people read them."""

from __future__ import annotations

MODIFIERS = ("ctrl", "shift", "alt")
"""Keys that are held while another is pressed, in the order of their names."""
_SAID = {
    "delete": "Del",
    "escape": "Esc",
    "page_up": "PgUp",
    "page_down": "PgDn",
    "equal": "=",
    "minus": "-",
    "comma": ",",
    "period": ".",
    "slash": "/",
    "semicolon": ";",
    "left_bracket": "[",
    "right_bracket": "]",
}
"""Keys that have another name on a keyboard than in a file."""


def spoken(key: str) -> str:
    """Returns a key as people read it: "ctrl+shift+z" is Ctrl+Shift+Z."""
    return "+".join(
        _SAID.get(part, part.upper() if len(part) < 2 else part.title()) for part in key.split("+")
    )
