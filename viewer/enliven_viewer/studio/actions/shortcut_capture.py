"""The state of changing a shortcut."""

from __future__ import annotations

from dataclasses import dataclass

from enliven_viewer.studio.actions.table import ActionTable


@dataclass
class ShortcutCapture:
    """The action of the shortcut that the artist is changing, and the pressed key.

    Attributes:
        action: its id; empty if no change is in progress.
        key: a pressed key that is the shortcut of another action, until the artist confirms or cancels;
            otherwise empty.
    """

    action: str = ""
    key: str = ""

    def begin(self, action: str) -> None:
        """Starts waiting for the shortcut of an action. An empty id cancels."""
        self.action, self.key = action, ""

    def press(self, table: ActionTable, key: str) -> None:
        """Handles a pressed key: assigns it if it is free. Escape cancels."""
        if key == "escape":
            self.begin("")
        elif table.find_conflict(self.action, key) is None:
            self.key = key
            self.assign_key(table)
        else:
            self.key = key

    def assign_key(self, table: ActionTable) -> None:
        """Assigns the key to the action, and removes it from the action that had it."""
        table.set_shortcut(self.action, self.key)
        self.begin("")
