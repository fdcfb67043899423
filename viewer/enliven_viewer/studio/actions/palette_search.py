"""The state of the command palette: the search text, and the highlighted result."""

from __future__ import annotations

from dataclasses import dataclass, field

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.actions.table import ActionTable


@dataclass
class PaletteSearch:
    """A search for an action by name.

    Attributes:
        typed: the search text.
        highlighted: index of the highlighted result, which Enter runs.
        refused: True if Enter was pressed on an unavailable action. Then the text field needs the focus
            again.
    """

    table: ActionTable
    typed: str = ""
    highlighted: int = 0
    refused: bool = False
    _matches: list[Action] | None = field(default=None, init=False)

    @property
    def matches(self) -> list[Action]:
        """Returns the matching actions, best match first."""
        if self._matches is None:
            self._matches = self.table.find(self.typed)
        return self._matches

    def set_text(self, typed: str) -> None:
        """Changes the search text, and highlights the best match."""
        if typed != self.typed:
            self.typed, self.highlighted, self._matches = typed, 0, None

    def move_highlight(self, count: int) -> None:
        """Moves the highlight down by `count`, or up if negative. It wraps around."""
        self.highlighted = (self.highlighted + count) % max(len(self.matches), 1)

    def highlighted_action(self) -> Action | None:
        """Returns the highlighted action if there is one and it is available."""
        action = self.matches[self.highlighted] if self.matches else None
        return action if action is not None and not action.why_not() else None
