"""Compares the open project with a version that another window saved to the same file."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Literal

from enliven.document import Project, are_identical
from enliven_viewer.language import later, tr

DifferenceSide = Literal["only here", "only in the file", "different"]

_ITEM_WORDS = {
    "characters": later("character"),
    "takes": later("take"),
    "streams": later("motion"),
    "bodies": later("performance"),
    "markers": later("marker"),
    "handling": later("visibility, lock or size of"),
    "views": later("view"),
    "sounds": later("sound"),
}
"""The displayed word for an item of each part of a project."""


@dataclass(frozen=True)
class Difference:
    """One item that differs between two versions of a project.

    Attributes:
        item: the kind and name of the item, such as "take walk".
        side: the version that has the item, or "different" if both do.
    """

    item: str
    side: DifferenceSide


def compare_projects(here: Project, saved: Project) -> tuple[Difference, ...]:
    """Returns the differences between the window's project and the saved project, in the window's order."""
    differences = list[Difference]()
    for part in fields(Project):
        open_items, saved_items = getattr(here, part.name), getattr(saved, part.name)
        kind_label = _ITEM_WORDS.get(part.name, part.name)
        for name in dict.fromkeys((*open_items, *saved_items)):
            if name not in saved_items:
                differences.append(Difference(tr("{0} {1}", tr(kind_label), name), "only here"))
            elif name not in open_items:
                differences.append(Difference(tr("{0} {1}", tr(kind_label), name), "only in the file"))
            elif not are_identical(open_items[name], saved_items[name]):
                differences.append(Difference(tr("{0} {1}", tr(kind_label), name), "different"))
    return tuple(differences)


def with_saved_items(here: Project, saved: Project) -> Project:
    """Returns the window's project plus the items that only the saved version has. Items in both keep the
    window's version.
    """
    parts = (part.name for part in fields(Project))
    return replace(here, **{name: {**getattr(saved, name), **getattr(here, name)} for name in parts})
