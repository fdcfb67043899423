"""Edits of the display state of characters (hidden, locked, order), and of the names of takes."""

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
    """Hides, shows, locks, unlocks or scales characters. None leaves a value unchanged.

    Args:
        size: scale of the characters on a stage, relative to their own size.
        exaggeration: strength with which their soft parts overshoot the motion on a stage.

    Raises:
        InputError: if the character does not exist.
    """
    handling = dict(project.handling)
    for name in names:
        project.character(name)
        current = handling.get(name, FREE)
        handling[name] = replace(
            current,
            hidden=current.hidden if hidden is None else hidden,
            locked=current.locked if locked is None else locked,
            size=current.size if size is None else size,
            exaggeration=current.exaggeration if exaggeration is None else exaggeration,
        )
    return replace(project, handling=handling)


def refuse_locked(old_project: Project, new_project: Project) -> None:
    """Raises an error if an edit changed a locked character. An edit that also unlocks it is allowed.

    Raises:
        InputError: if an edit changed a locked character. The message names the character and how to unlock
            it.
    """
    for name, handling in old_project.handling.items():
        is_unlocked = name in new_project.characters and not new_project.handling.get(name, FREE).locked
        if (
            handling.locked
            and not is_unlocked
            and new_project.characters.get(name) is not old_project.characters[name]
        ):
            remedy = "Unlock the character in the list of shapes first."
            raise InputError(
                "the character is locked", where=old_project.characters[name].where, remedy=remedy
            )


def order_characters(project: Project, name: str, place: int) -> Project:
    """Moves a character to position ``place`` in the project's list of characters. Position 0 is the first.

    Raises:
        InputError: if the character does not exist.
    """
    moved_character = project.character(name)
    others = [character for character in project.characters.values() if character is not moved_character]
    place = min(max(place, 0), len(others))
    ordered = [*others[:place], moved_character, *others[place:]]
    return replace(project, characters={character.id: character for character in ordered})


def rename_take(project: Project, name: str, new_name: str) -> Project:
    """Renames a take. Characters that play it keep playing it.

    Raises:
        InputError: if the take does not exist, or the name is taken.
    """
    take = project.takes.get(name)
    if take is None or not new_name or (new_name != name and new_name in project.takes):
        problem = f"the project has no take {name!r}" if take is None else "the new name is empty or in use"
        raise InputError(problem, where=f"take {name!r}", remedy="Choose another name.")
    takes = {
        (new_name if number == name else number): (replace(take, id=new_name) if number == name else old_take)
        for number, old_take in project.takes.items()
    }
    users = {
        key: character.with_takes_named(
            {
                (collection, number): (new_name if (collection, number) == ("takes", name) else number)
                for collection, ids in character.find_needed_ids().items()
                for number in ids
            }
        )
        for key, character in project.characters.items()
        if name in character.find_needed_ids()["takes"]
    }
    return replace(project, takes=takes, characters={**project.characters, **users})


def delete_take(project: Project, name: str) -> Project:
    """Deletes a take that no character plays.

    Raises:
        InputError: if the take does not exist, or a character plays it.
    """
    users = [
        character.id
        for character in project.characters.values()
        if name in character.find_needed_ids()["takes"]
    ]
    if name not in project.takes or users:
        problem = f"the character {users[0]} plays this take" if users else "this take does not exist"
        remedy = "Remove the character's clips of this take from the timeline first." if users else ""
        raise InputError(problem, where=f"take {name!r}", remedy=remedy)
    return replace(project, takes={k: take for k, take in project.takes.items() if k != name})
