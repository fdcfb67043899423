"""An action: its name, what it does, when it can be done, and its keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


def always() -> str:
    """Returns the reason against an action that can always be done: none."""
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
        why_not: why it cannot be done now, and what to do about it; empty if it can.
        on: for a switch, whether it is on.
        about: one sentence of what it does, for its tooltip.
        icon: its glyph in Font Awesome 4, for buttons.
        apart: a line stands above it in its menu.
        group: the menu within its menu that shows it, without what is before a colon in its label; or empty.
        rooms: the workspaces in which its keys mean it, before what they mean elsewhere; empty for all.
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
    group: str = ""
    rooms: tuple[str, ...] = ()

    @property
    def entry(self) -> str:
        """Returns its name in its menu: "legs" for "With: legs" in the menu "With"."""
        return self.label.removeprefix(f"{self.group}: ") if self.group else self.label

    @property
    def place(self) -> str:
        """Returns where it is found: "Perform/With/legs"."""
        return "/".join(part for part in (self.menu, self.group, self.entry) if part)

    def rivals(self, other: Action) -> bool:
        """Returns True if a key cannot be that of both: they share a workspace, or both have theirs
        everywhere.
        """
        return not (self.rooms or other.rooms) or bool({*self.rooms} & {*other.rooms})
