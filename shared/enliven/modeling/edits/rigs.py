"""The table of rigs, and functions that return the pose of a character with any rig at a time."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import ExampleCharacter, GraphCharacter, Pose, Project, RigBase, RiggedCharacter
from enliven.errors import InputError
from enliven.modeling.edits.root_motion_rig import RootMotionRig, remove_root_layers
from enliven.modeling.possessed.rig import GraphRig
from enliven.modeling.puppet.rig import PuppetRig
from enliven.modeling.rig import RigEdits
from enliven.modeling.rigged.rig import ShapeRig

RIGS: dict[str, RigEdits] = {
    RiggedCharacter.kind: ShapeRig(),
    GraphCharacter.kind: GraphRig(),
    ExampleCharacter.kind: PuppetRig(),
}
"""The edits of every kind of rig, by the name of the kind. Register further kinds here."""


def get_rig_edits(character: RigBase) -> RigEdits:
    """Returns the edits for a character's rig.

    If the character has root layers, the edits are wrapped to apply them.
    """
    rig_edits = RIGS[character.kind]
    return RootMotionRig(rig_edits) if character.root_layers else rig_edits


def bake_root_layers(project: Project, character: RigBase, time: float) -> RigBase:
    """Returns the character without root layers, moved to its position with them at a time of the project."""
    baked = project.with_characters(character)
    return remove_root_layers(RIGS[character.kind], baked, character.id, time).character(character.id)


def handle_number(character: RigBase, handle: int | str) -> int:
    """Returns the number of a handle given by number or name.

    Raises:
        InputError: if the handle does not exist. The message lists the existing handles.
    """
    names = character.handles
    number = names.index(handle) if handle in names else handle
    if isinstance(number, str) or not 0 <= number < len(names):
        known_handles = ", ".join(names) or "none"
        raise InputError(
            f"the character has no handle {handle!r}",
            where=character.where,
            remedy=f"Known handles: {known_handles}.",
        )
    return number


def compute_vertices(project: Project, character_id: str, time: float) -> Float:
    """Returns the vertices (V, 3) in metres of a character at a time of the project.

    Raises:
        InputError: if the character does not exist, or lacks data that it needs to move.
    """
    character = project.character(character_id)
    return get_rig_edits(character).compute_vertices(project, character, time)


def pose_of_character(project: Project, character_id: str, time: float) -> Pose:
    """Returns the transforms of a character for the network and the viewer.

    Raises the same errors as :func:`compute_vertices`.
    """
    character = project.character(character_id)
    return get_rig_edits(character).create_player(project, character)(time).pose


def find_base_centre(vertices: Float) -> Float:
    """Returns the centre (3,) in metres of the bounding box of vertices (V, 3) at the height of the lowest
    vertex.
    """
    low, high = vertices.min(0), vertices.max(0)
    return np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
