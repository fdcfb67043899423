"""The rows of the outliner: groups, characters with their handles, takes, and the live stage."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from enliven.document import ExampleCharacter, GraphCharacter, Project, RigBase
from enliven.overdub.performance_takes import ONLOOKER_SUFFIX
from enliven_viewer.language import later, tr

GROUP, CHARACTER, HANDLE, TAKE, LIVE = "group", "character", "handle", "take", "live"
"""The kinds of rows."""
_HANDLE_WORDS = {ExampleCharacter.kind: later("point"), GraphCharacter.kind: later("part")}
"""The displayed word for a handle, by rig kind; "bone" for other rigs."""


@dataclass(frozen=True)
class Row:
    """One line of the tree.

    Attributes:
        kind: the kind of the row.
        id: name of the character, take, group or live stage.
        number: number of the character's handle; -1 for none.
        label: the shown text.
        note: the text after the label.
        depth: level of indentation.
        folds: whether it has child rows that can be folded.
    """

    kind: str
    id: str
    label: str
    note: str = ""
    number: int = -1
    depth: int = 0
    folds: bool = False

    @property
    def key(self) -> str:
        """Returns a key that is unique among the rows."""
        return f"{self.kind} {self.id}" + (f" {self.number}" if self.number >= 0 else "")


def make_rows(
    project: Project, live: tuple[str, ...], opened: Collection[str], typed: str = ""
) -> tuple[Row, ...]:
    """Returns the visible rows.

    Args:
        live: one line per object on the stage of an edge; empty without an edge.
        opened: keys of the unfolded rows.
        typed: filter text. Rows with matching names are shown together with their parents.
    """
    matches = (
        _filter_rows(list(_make_all_rows(project, live)), typed.strip().lower()) if typed.strip() else None
    )
    if matches is not None:
        return tuple(matches)
    shown: list[Row] = []
    closed = 99  # Larger than any depth, so that no row is hidden at first.
    for row in _make_all_rows(project, live):
        if row.depth > closed:
            continue
        closed = row.depth if row.folds and row.key not in opened else 99
        shown.append(row)
    return tuple(shown)


def _filter_rows(rows: list[Row], wanted: str) -> list[Row]:
    """Returns the rows that contain the text, and their parents."""
    keep = [wanted in row.label.lower() and row.kind != GROUP for row in rows]
    above: list[int] = []
    for number, row in enumerate(rows):
        above = [parent for parent in above if rows[parent].depth < row.depth]
        if keep[number]:
            for parent in above:
                keep[parent] = True
        above.append(number)
    return [row for row, is_kept in zip(rows, keep, strict=True) if is_kept]


def _make_all_rows(project: Project, live: tuple[str, ...]) -> Iterator[Row]:
    yield Row(GROUP, "shapes", later("Shapes"), str(len(project.characters)), folds=True)
    for character in project.characters.values():
        below = list(_make_handle_rows(character))
        yield Row(CHARACTER, character.id, character.id, character.word, depth=1, folds=bool(below))
        yield from below
    used = set().union(*(character.find_needed_ids()["takes"] for character in project.characters.values()))
    yield Row(GROUP, "takes", later("Takes"), str(len(project.takes)), folds=True)
    folded = [name for name in project.takes if name not in used and _is_onlooker(name)]
    for name in (name for name in project.takes if name not in folded):
        note = f"{project.takes[name].duration:.1f} s" + (tr(" · in use") if name in used else "")
        yield Row(TAKE, name, name, note, depth=1)
    if folded:
        yield Row(GROUP, "onlookers", later("Without a character"), str(len(folded)), depth=1, folds=True)
        for name in folded:
            yield Row(TAKE, name, name, f"{project.takes[name].duration:.1f} s", depth=2)
    if live:
        yield Row(GROUP, "live", later("Live stage"), str(len(live)), folds=True)
        for number, line in enumerate(live):
            yield Row(LIVE, "stage", line, number=number, depth=1)


def _is_onlooker(name: str) -> bool:
    """Returns True if the take's name marks a performer who controlled nothing while others did."""
    return name.rstrip("0123456789").rstrip().endswith(ONLOOKER_SUFFIX)


def _make_handle_rows(character: RigBase) -> Iterator[Row]:
    """Yields the rows of a character's handles: joints below their parents, control points in order, or parts
    of a possessed mesh.
    """
    handle_label = _HANDLE_WORDS.get(character.kind, later("bone"))
    for number, take in enumerate(character.performed_parts):
        yield Row(HANDLE, character.id, take, handle_label, number, 2)
    parents, names = character.parents, character.handles
    below: dict[int, list[int]] = {}
    for number, parent in enumerate(parents):
        below.setdefault(int(parent), []).append(number)
    waiting = [(number, 2) for number in reversed(below.get(-1, []))]
    while waiting:
        number, depth = waiting.pop()
        children = below.get(number, [])
        yield Row(
            HANDLE,
            character.id,
            names[number],
            later("root") if _is_bone_root(parents, number) else handle_label,
            number,
            depth,
        )
        # Indent only below a fork. A chain stays at the same depth, so that an arm of twenty bones fits the
        # panel.
        deeper = depth + (len(children) > 1)
        waiting += [(child, deeper) for child in reversed(children)]


def _is_bone_root(parents: np.ndarray, number: int) -> bool:
    """Returns True if a joint is the root of a skeleton."""
    return bool(parents[number] < 0 and (parents >= 0).any())
