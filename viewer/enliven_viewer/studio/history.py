"""The past of a project: since an edit makes another value, undo is the one before."""

from __future__ import annotations

from enliven.project import Project


class History:
    """Projects one after the other, and where in them we are.

    Args:
        most: how many edits are remembered; values share what they have in common, so they are small.
    """

    def __init__(self, first: Project, most: int = 1000) -> None:
        self._steps: list[tuple[str, Project]] = [("", first)]
        self._at, self._most = 0, most

    @property
    def now(self) -> Project:
        """The project as it is."""
        return self._steps[self._at][1]

    def do(self, name: str, after: Project) -> None:
        """Remember what an edit made; what was undone is forgotten."""
        del self._steps[self._at + 1 :]
        self._steps.append((name, after))
        del self._steps[: max(len(self._steps) - self._most - 1, 0)]
        self._at = len(self._steps) - 1

    def undo(self) -> str | None:
        """Go one edit back; its name, or None where there is none."""
        if self._at == 0:
            return None
        self._at -= 1
        return self._steps[self._at + 1][0]

    def redo(self) -> str | None:
        """Go one edit forward; its name, or None where there is none."""
        if self._at + 1 == len(self._steps):
            return None
        self._at += 1
        return self._steps[self._at][0]
