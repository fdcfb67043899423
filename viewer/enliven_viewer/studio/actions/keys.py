"""Converts shortcuts between their saved form, such as "ctrl+shift+z", and their displayed form."""

from __future__ import annotations

MODIFIERS = ("ctrl", "shift", "alt")
"""The modifier keys, in the order of their names in a shortcut."""
_KEY_LABELS = {
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
"""Displayed names of the keys that are saved under other names."""


def format_key(key: str) -> str:
    """Returns a shortcut as displayed: "ctrl+shift+z" becomes Ctrl+Shift+Z."""
    return "+".join(
        _KEY_LABELS.get(part, part.upper() if len(part) < 2 else part.title()) for part in key.split("+")
    )
