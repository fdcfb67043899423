"""Edits of how a window treats the things of a project: what is hidden or locked, their names and order."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from enliven.document import FREE, Project
from enliven.errors import InputError


def handle_characters(
    project: Project,
    names: Iterable[str],
    *,
    hidden: bool | None = None,
    locked: bool | None = None,
    size: float | None = None,
    exaggeration: float | None = None,
) -> Project:
    """A project in which characters are hidden or shown, locked or free; None leaves that as it is.

    Args:
        size: how many times their own size they stand on a stage.
        exaggeration: how far their soft parts swing past the motion there.

    Raises:
        InputError: where there is no such character.
    """
    handling = dict(project.handling)
    for name in names:
        project.character(name)
        now = handling.get(name, FREE)
        handling[name] = replace(
            now,
            hidden=now.hidden if hidden is None else hidden,
            locked=now.locked if locked is None else locked,
            size=now.size if size is None else size,
            exaggeration=now.exaggeration if exaggeration is None else exaggeration,
        )
    return replace(project, handling=handling)


def refuse_locked(before: Project, after: Project) -> None:
    """Refuse an edit that changed a locked character; one that unlocks it as well may.

    Raises:
        InputError: which character is locked, and how to unlock it.
    """
    for name, handling in before.handling.items():
        freed = name in after.characters and not after.handling.get(name, FREE).locked
        if handling.locked and not freed and after.characters.get(name) is not before.characters[name]:
            mend = "Open its lock in the list of shapes first."
            raise InputError("it is locked", where=before.characters[name].where, mend=mend)


def order_characters(project: Project, name: str, place: int) -> Project:
    """A project with a character at another place among the others; 0 is the first.

    Raises:
        InputError: where there is no such character.
    """
    moved = project.character(name)
    rest = [one for one in project.characters.values() if one is not moved]
    place = min(max(place, 0), len(rest))
    ordered = [*rest[:place], moved, *rest[place:]]
    return replace(project, characters={one.id: one for one in ordered})


def rename_take(project: Project, name: str, wanted: str) -> Project:
    """A project with a take under another name; what plays it goes on playing it.

    Raises:
        InputError: where there is no such take, or another is called so.
    """
    take = project.takes.get(name)
    if take is None or not wanted or (wanted != name and wanted in project.takes):
        what = f"there is no take {name!r}" if take is None else "it needs a name of its own"
        raise InputError(what, where=f"take {name!r}", mend="Choose another name.")
    takes = {
        (wanted if k == name else k): (replace(take, id=wanted) if k == name else t)
        for k, t in project.takes.items()
    }
    users = {
        key: one.with_takes_named(
            {
                (held, k): (wanted if (held, k) == ("takes", name) else k)
                for held, ids in one.needed().items()
                for k in ids
            }
        )
        for key, one in project.characters.items()
        if name in one.needed()["takes"]
    }
    return replace(project, takes=takes, characters={**project.characters, **users})


def delete_take(project: Project, name: str) -> Project:
    """A project without a take that nothing plays.

    Raises:
        InputError: where there is none, or a character plays it.
    """
    users = [one.id for one in project.characters.values() if name in one.needed()["takes"]]
    if name not in project.takes or users:
        what = f"{users[0]} plays it" if users else "it is not there"
        mend = "Remove its clips from the timeline first." if users else ""
        raise InputError(what, where=f"take {name!r}", mend=mend)
    return replace(project, takes={k: one for k, one in project.takes.items() if k != name})
