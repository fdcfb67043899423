"""Functions for a character with any rig, given by its id."""

from __future__ import annotations

from dataclasses import replace

from enliven.document import Project
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.edits import compute_vertices, copy_character, cut_character, merge_characters

copy = copy_character
cut = cut_character
merge = merge_characters


def mesh_at(project: Project, character: str, time: float) -> Mesh:
    """Returns the posed mesh of a character at a time of the project, in metres of the world.

    Args:
        character: id of the character.
        time: seconds of the project.

    Raises:
        InputError: if the character does not exist, or has no mesh.
    """
    mesh = project.character(character).mesh
    if mesh is None:
        raise InputError(
            "the character has no mesh",
            where=f"character {character!r}",
            remedy="Add a mesh to the character.",
        )
    return replace(mesh, vertices=compute_vertices(project, character, time))
