"""An action that waits for another key."""

from __future__ import annotations

from dataclasses import dataclass

from enliven_viewer.studio.actions.table import ActionTable


@dataclass
class WantedKey:
    """The action that is to have another key, and the key that was pressed for it.

    Attributes:
        action: its id; empty if none waits.
        key: a key that is another action's, until it is taken or left; else empty.
    """

    action: str = ""
    key: str = ""

    def begin(self, action: str) -> None:
        """Waits for the key of an action; of none if it is empty."""
        self.action, self.key = action, ""

    def press(self, table: ActionTable, key: str) -> None:
        """Takes a pressed key where it is free; Escape ends the waiting."""
        if key == "escape":
            self.begin("")
        elif table.rival(self.action, key) is None:
            self.key = key
            self.take(table)
        else:
            self.key = key

    def take(self, table: ActionTable) -> None:
        """Gives the action the key, and takes it from another."""
        table.give(self.action, self.key)
        self.begin("")
