"""Reconstructs rigged models from a recording. A live performance of a rigged character becomes a shape and a
clip.

Transmitted characters contain transforms with pivots, but no joints. So the joints are reconstructed: a bone
begins at its pivot, and bones with the same pivot begin at the same joint.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import Character, Clip, Pose, RiggedCharacter, Skeleton, still_shape
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.motion_clips.recorded_characters import even_times, interpolate_linearly
from enliven.rotation import from_matrix, remove_sign_jumps


def shape_and_clip_from_poses(
    character: Character, poses: Sequence[Pose], begin: int = 0
) -> tuple[RiggedCharacter, Clip, float]:
    """Converts a rigged character to a shape and a clip with evenly spaced frames. Also returns the time in
    seconds at which the clip begins.

    Args:
        poses: at least two poses, in the order of time.
        begin: time of the sensor's clock at 0 seconds, nanoseconds.

    Raises:
        InputError: if a bone has no parent, or there are too few poses, or they are too far apart.
    """
    used_poses, seconds, grid = even_times(character, list(poses), begin)
    skeleton = skeleton_from_bones(character)
    mesh = Mesh(np.asarray(character.vertices, np.float64), character.faces, character.id, character.colours)
    turns = from_matrix(
        interpolate_linearly(np.array([pose.linear for pose in used_poses], np.float64), seconds, grid)
    )
    root = interpolate_linearly(
        np.array([pose.positions[0] for pose in used_poses], np.float64), seconds, grid
    )
    clip = Clip(character.id, skeleton, remove_sign_jumps(turns), root, float(grid[1] - grid[0]))
    return still_shape(character.id, skeleton, mesh, character.skin), clip, float(grid[0])


def skeleton_from_bones(character: Character) -> Skeleton:
    """Reconstructs the skeleton of a character with bones. Joint j is the end of bone j, which transform j
    moves.

    Raises:
        InputError: if a bone has no parent.
    """
    pivots: Float = np.asarray(character.pivots, np.float64)
    count = len(pivots)
    parents, positions = np.full(count, -1), np.full((count, 3), np.nan)
    positions[0] = pivots[0]
    for bone, child in character.edges:
        if 0 < bone < child and parents[child] < 0:
            parents[child], positions[bone] = bone, pivots[child]
    for bone in range(1, count):
        if parents[bone] < 0:
            begins = np.flatnonzero((positions[:bone] == pivots[bone]).all(1))
            if not len(begins):
                problem = f"its bone {bone} has no parent"
                raise InputError(problem, where=f"character {character.id!r}", remedy="Record it again.")
            parents[bone] = begins[0]
    for bone in np.flatnonzero(np.isnan(positions[:, 0])):
        positions[bone] = _limb_end(character, int(bone), pivots[bone], positions[parents[parents[bone]]])
    names = character.names or ("root", *(f"bone {bone}" for bone in range(1, count)))
    return Skeleton(names, parents.astype(np.int32), positions)


def _limb_end(character: Character, bone: int, begin: Float, previous_joint: Float) -> Float:
    """Returns the end (3,) of a limb's last bone. Its distance from the bone's start is twice that of the
    centre of the bone's vertices. Without vertices, the bone continues the previous bone in a straight line,
    with half of its length.
    """
    strongest = character.skin.indices[np.arange(len(character.vertices)), character.skin.weights.argmax(1)]
    bone_vertices = character.vertices[strongest == bone]
    return np.asarray(
        2 * bone_vertices.mean(0, np.float64) - begin
        if len(bone_vertices)
        else 1.5 * begin - 0.5 * previous_joint
    )
