"""An action: its name, function, availability and shortcuts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


def give_no_reason() -> str:
    """Returns an empty reason: the action is always available."""
    return ""


@dataclass(frozen=True)
class Action:
    """A command that an artist can run.

    Attributes:
        id: a permanent name that saved shortcuts refer to. It consists of menu and command, such as
            "file.save".
        menu: the menu that shows it.
        label: its name in menus, in the command palette and on buttons.
        keys: default shortcuts; the first is displayed.
        do: runs the action. An EnlivenError that it raises is shown.
        why_not: returns the reason why the action is unavailable now, with advice; empty if it is available.
        is_on: for a toggle, returns whether it is on.
        about: one sentence about its effect, for the tooltip.
        icon: its glyph in Font Awesome 4, for buttons.
        apart: True to draw a separator above it in the menu.
        group: the submenu that shows it, or empty. The submenu omits the part of the label before the colon.
        workspaces: the workspaces in which its shortcuts are active and take precedence over general ones;
            empty for all.
    """

    id: str
    menu: str
    label: str
    keys: tuple[str, ...]
    do: Callable[[], object]
    why_not: Callable[[], str] = give_no_reason
    is_on: Callable[[], bool] | None = None
    about: str = ""
    icon: str = ""
    apart: bool = False
    group: str = ""
    workspaces: tuple[str, ...] = ()

    @property
    def entry(self) -> str:
        """Returns its label in its menu, without the submenu: "legs" for "Body parts: legs"."""
        return self.label.removeprefix(f"{self.group}: ") if self.group else self.label

    @property
    def place(self) -> str:
        """Returns its menu path, such as "Perform/Body parts/legs"."""
        return "/".join(part for part in (self.menu, self.group, self.entry) if part)

    def conflicts_with(self, other: Action) -> bool:
        """Returns True if the two actions cannot have the same shortcut, because they share a workspace or
        are both active everywhere.
        """
        return not (self.workspaces or other.workspaces) or bool({*self.workspaces} & {*other.workspaces})
