"""Undo and redo: a project is an immutable value, so its history is a list of values."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.document.project import Project, are_identical
from enliven.document.rig import RigBase
from enliven.errors import InputError
from enliven.settings import parameter


@dataclass(frozen=True)
class HistorySettings:
    """Settings for the memory of the undo history."""

    megabytes: float = parameter(
        1024.0,
        "Maximum memory for all undo steps. If the steps need more memory, the oldest are deleted.",
        unit="MB",
        low=0.0,
    )


@dataclass(frozen=True)
class _Step:
    name: str
    project: Project
    drag: str | None = None


class History:
    """A project and its earlier values, one before each edit.

    Every call of :meth:`record_edit` adds one named step. Successive edits of one ``drag`` form a single
    step, until :meth:`end_drag`. Equal arrays are stored once, so a step needs memory only for its changes.
    The memory is
    limited: the oldest steps are dropped, but never the current project.
    """

    def __init__(self, project: Project, settings: HistorySettings | None = None) -> None:
        self._settings = settings or HistorySettings()
        self._steps = [_Step("", project)]
        self._at = 0
        self._count: Counter[int] = Counter()
        self._bytes = 0
        self._hold_arrays(project)

    @property
    def project(self) -> Project:
        """The current project."""
        return self._steps[self._at].project

    @property
    def undo_name(self) -> str | None:
        """Name of the step that undo would revert, or None at the first step."""
        return self._steps[self._at].name if self._at else None

    @property
    def redo_name(self) -> str | None:
        """Name of the step that redo would restore, or None at the last step."""
        return self._steps[self._at + 1].name if self._at + 1 < len(self._steps) else None

    @property
    def names(self) -> tuple[str, ...]:
        """The steps that undo can revert, the oldest first."""
        return tuple(step.name for step in self._steps[1 : self._at + 1])

    @property
    def steps(self) -> tuple[str, ...]:
        """All steps, including undone ones. The first has no name, and is the initial project."""
        return tuple(step.name for step in self._steps)

    @property
    def current_step(self) -> int:
        """The number of the step that created the current project."""
        return self._at

    def go_to_step(self, step: int) -> Project:
        """Goes back or forward to a step, and returns the project after it.

        Raises:
            InputError: if the step does not exist.
        """
        if not 0 <= step < len(self._steps):
            raise InputError(
                f"the undo step {step} does not exist",
                where="history",
                remedy=f"The history contains the steps 0 to {len(self._steps) - 1}.",
            )
        self.end_drag()
        self._at = step
        return self.project

    @property
    def megabytes(self) -> float:
        """Memory of the arrays of all steps in megabytes. Each array counts once."""
        return self._bytes / 1e6

    def record_edit(self, name: str, project: Project, *, drag: str | None = None) -> Project:
        """Records the project after an edit. Undone steps can no longer be redone.

        Args:
            name: name of the step, for the menu.
            drag: identifies a mouse drag that makes many edits. All its edits form one step.
        """
        for step in self._steps[self._at + 1 :]:
            self._drop_oldest_steps(step.project)
        del self._steps[self._at + 1 :]
        top = self._steps[-1]
        going_on = drag is not None and top.drag == drag and self._at > 0
        previous = self._steps[-2].project if going_on else top.project
        project = share_equal_parts(project, previous)
        if going_on:
            self._drop_oldest_steps(self._steps.pop().project)
        self._steps.append(_Step(name, project, drag))
        self._at = len(self._steps) - 1
        self._hold_arrays(project)
        self._forget_oldest()
        return project

    def end_drag(self) -> None:
        """Ends a drag. The next edit becomes a separate step."""
        self._steps[self._at] = replace(self._steps[self._at], drag=None)

    def undo(self) -> Project:
        """Reverts the last step, and returns the project.

        Raises:
            InputError: if the project is at the first step.
        """
        if self._at == 0:
            raise InputError("there is nothing to undo", where="history")
        self.end_drag()
        self._at -= 1
        return self.project

    def redo(self) -> Project:
        """Restores the step that was undone last, and returns the project.

        Raises:
            InputError: if nothing was undone.
        """
        if self._at + 1 == len(self._steps):
            raise InputError("there is nothing to redo", where="history")
        self._at += 1
        return self.project

    def _hold_arrays(self, project: Project) -> None:
        for array in _iterate_arrays(project):
            self._count[id(array)] += 1
            if self._count[id(array)] == 1:
                self._bytes += array.nbytes

    def _drop_oldest_steps(self, project: Project) -> None:
        for array in _iterate_arrays(project):
            self._count[id(array)] -= 1
            if self._count[id(array)] == 0:
                self._bytes -= array.nbytes
                del self._count[id(array)]

    def _forget_oldest(self) -> None:
        """Drops the oldest steps while the memory limit is exceeded, but never the current project."""
        while self._at > 0 and self._bytes > self._settings.megabytes * 1e6:
            self._drop_oldest_steps(self._steps.pop(0).project)
            self._at -= 1


def share_equal_parts(project: Project, old_project: Project) -> Project:
    """Returns the project with shared memory. All parts that are bit-identical to parts of ``old_project``
    are replaced by the old parts.
    """
    maps = {}
    for part in fields(project):
        old: Mapping[str, Any] = getattr(old_project, part.name)
        maps[part.name] = {
            k: _reuse_equal_parts(new, old.get(k)) for k, new in getattr(project, part.name).items()
        }
    return Project(**maps)


def _reuse_equal_parts(new: Any, old: Any) -> Any:
    """Returns ``old`` if it equals ``new``. For two characters of the same kind, equal attributes are
    reused.
    """
    if old is None or new is old:
        return new
    if are_identical(new, old):
        return old
    if isinstance(new, RigBase) and type(new) is type(old):
        parts = {part.name: (getattr(new, part.name), getattr(old, part.name)) for part in fields(new)}
        return type(new)(**{name: b if are_identical(a, b) else a for name, (a, b) in parts.items()})
    return new


def _iterate_arrays(part: object) -> Iterator[AnyArray]:
    """Yields every array in a project or a part of one."""
    if isinstance(part, np.ndarray):
        yield part
    elif is_dataclass(part):
        for entry in fields(part):
            yield from _iterate_arrays(getattr(part, entry.name))
    elif isinstance(part, Mapping):
        for value in part.values():
            yield from _iterate_arrays(value)
    elif isinstance(part, tuple):
        for value in part:
            yield from _iterate_arrays(value)
