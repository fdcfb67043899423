"""Edits of a character of any kind, by its id: a rigged shape, a possessed mesh, or a puppet."""

from __future__ import annotations

from dataclasses import replace

from enliven.arrays import AnyArray
from enliven.document import Project
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.edits import copy_character, cut_character, merge_characters, vertices_of
from enliven.modeling.mesh import CutSurface


def cut(
    project: Project, character: str, surface: CutSurface, time: float
) -> tuple[Project, tuple[str, ...]]:
    """A project with a character cut in two along a plane or a stroke; both parts go on moving.

    At ``time`` nothing turns or moves. The meshes are closed where they were cut.

    Args:
        character: its id.
        surface: a ``PlaneCut`` or ``StrokeCut``, in metres of the world.
        time: seconds of the project.

    Returns:
        The project, and the ids of the parts; the first keeps its id.

    Raises:
        InputError: where there is no such character, or nothing of it comes off.
    """
    return cut_character(project, character, surface, time)


def merge(
    project: Project,
    host: str,
    graft: str,
    time: float,
    joint: int | str | None = None,
    *,
    loose: bool = False,
) -> Project:
    """A project in which one character is put onto another, of its kind or of another, where both are.

    From then on the graft rides on the host, with its own motion on top; the meshes become one. What becomes
    of two kinds, :func:`enliven.modeling.edits.merge_characters` says.

    Args:
        host, graft: their ids; the whole keeps the host's.
        time: seconds of the project.
        joint: of a rigged host, by number or name, that the graft is put onto, or a node of a possessed one;
            None takes the nearest.
        loose: put both shells into one mesh where no union of the meshes can be made.

    Raises:
        InputError: for a character merged with itself, or meshes without a union.
    """
    return merge_characters(project, host, graft, time, node=joint, loose=loose)


def copy(
    project: Project, character: str, *, offset: AnyArray | None = None, delay: float = 0.0
) -> tuple[Project, str]:
    """A project with a copy of a character, which moves as it does, and the copy's id.

    Args:
        character: its id.
        offset: (3,) metres from the character to its copy; None puts it there as well.
        delay: seconds by which the copy moves later.

    Raises:
        InputError: where there is no such character, or a number is not finite.
    """
    return copy_character(project, character, offset=(0, 0, 0) if offset is None else offset, delay=delay)


def mesh_at(project: Project, character: str, time: float) -> Mesh:
    """The mesh of a character as it is at a time of the project, in metres of the world.

    Args:
        character: its id.
        time: seconds of the project.

    Raises:
        InputError: where there is no such character, or it has no mesh.
    """
    mesh = project.character(character).mesh
    if mesh is None:
        where = project.character(character).where
        raise InputError("it has no mesh", where=where, mend="Give it one, or draw its bones.")
    return replace(mesh, vertices=vertices_of(project, character, time))
