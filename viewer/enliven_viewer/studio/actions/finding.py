"""The state of the palette: what is typed, and which of the actions found is marked."""

from __future__ import annotations

from dataclasses import dataclass, field

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.actions.table import ActionTable


@dataclass
class Finding:
    """Letters that are typed to find an action.

    Attributes:
        typed: the letters.
        marked: the number of the action that Enter does, among those found.
        refused: Enter was pressed for an action that cannot be done; letters are to be typed again.
    """

    table: ActionTable
    typed: str = ""
    marked: int = 0
    refused: bool = False
    _found: list[Action] | None = field(default=None, init=False)

    @property
    def found(self) -> list[Action]:
        """Returns the actions that the letters may mean, the likeliest first."""
        if self._found is None:
            self._found = self.table.find(self.typed)
        return self._found

    def type(self, typed: str) -> None:
        """Takes other letters; the likeliest action is marked."""
        if typed != self.typed:
            self.typed, self.marked, self._found = typed, 0, None

    def step(self, count: int) -> None:
        """Marks an action further down, or above 0 counts; the last is followed by the first."""
        self.marked = (self.marked + count) % max(len(self.found), 1)

    def chosen(self) -> Action | None:
        """Returns the marked action, where one is found and it can be done now."""
        one = self.found[self.marked] if self.found else None
        return one if one is not None and not one.why_not() else None
