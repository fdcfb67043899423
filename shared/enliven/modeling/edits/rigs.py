"""The table of rigs, and a character of any rig at a moment."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import GraphShape, Pose, Project, Puppet, RigBase, Shape
from enliven.errors import InputError
from enliven.modeling.edits.rooted import RootedRig, set_down
from enliven.modeling.possessed import GraphRig
from enliven.modeling.puppet import PuppetRig
from enliven.modeling.rig import RigEdits
from enliven.modeling.rigged import ShapeRig

RIGS: dict[str, RigEdits] = {
    Shape.kind: ShapeRig(),
    GraphShape.kind: GraphRig(),
    Puppet.kind: PuppetRig(),
}
"""The edits of every kind of rig; a fourth has its line here."""


def rig_of(character: RigBase) -> RigEdits:
    """The edits of a character's rig, and of the layers of its root where it has some."""
    own = RIGS[character.kind]
    return RootedRig(own) if character.root_layers else own


def as_standing(project: Project, character: RigBase, time: float) -> RigBase:
    """The character without the layers of its root, where they have it at a time of the project."""
    standing = project.with_characters(character)
    return set_down(RIGS[character.kind], standing, character.id, time).character(character.id)


def handle_number(character: RigBase, handle: int | str) -> int:
    """The number of a handle that is given by number or name.

    Raises:
        InputError: where there is none, with those that there are.
    """
    names = character.handles
    number = names.index(handle) if handle in names else handle
    if isinstance(number, str) or not 0 <= number < len(names):
        known = ", ".join(names) or "none"
        raise InputError(f"there is no handle {handle!r}", where=character.where, mend=f"Known: {known}.")
    return number


def vertices_of(project: Project, character_id: str, time: float) -> Float:
    """(V, 3) metres: where the vertices of a character are at a time of the project.

    Raises:
        InputError: where there is none, or it lacks something to move.
    """
    character = project.character(character_id)
    return rig_of(character).seen(project, character, time)


def pose_of_character(project: Project, character_id: str, time: float) -> Pose:
    """The transforms of a character for the wire and the viewer, as :func:`vertices_of`."""
    character = project.character(character_id)
    return rig_of(character).player(project, character)(time).pose


def foot_of(vertices: Float) -> Float:
    """(3,) metres: the middle of the box of vertices (V, 3), at the height of the lowest."""
    low, high = vertices.min(0), vertices.max(0)
    return np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
