"""An action: its name, what it does, when it can be done, and its keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


def always() -> str:
    """The reason against an action that can always be done: none."""
    return ""


@dataclass(frozen=True)
class Action:
    """Something that an artist can do.

    Attributes:
        id: a name that stays, as in saved keys: the menu and the deed, such as "file.save".
        menu: the menu that shows it.
        label: its name in menus, in the palette and on buttons.
        keys: its keys until the artist gives it others; the first is shown.
        do: does it; an EnlivenError that it raises is shown.
        why_not: why it cannot be done now, and what to do about it; empty where it can.
        on: for a switch, whether it is on.
        about: one sentence of what it does, for its tooltip.
        icon: its glyph in Font Awesome 4, for buttons.
        apart: a line stands above it in its menu.
    """

    id: str
    menu: str
    label: str
    keys: tuple[str, ...]
    do: Callable[[], object]
    why_not: Callable[[], str] = always
    on: Callable[[], bool] | None = None
    about: str = ""
    icon: str = ""
    apart: bool = False
