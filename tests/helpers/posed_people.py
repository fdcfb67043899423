"""A pose that distinguishes left from right and front from back, for a performer and for characters."""

from __future__ import annotations

import numpy as np

from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.skeleton import Skeleton
from enliven.person.body import Body
from enliven.rotation import from_rotation_vector, multiply, rotate, to_matrix
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture, rotation


def performer(id: int = 1, place=(0.4, 0.94, -2.0), yaw: float = 0.6, height: float = 1.75) -> Body:
    """Returns a performer: the left arm to the front, the right arm out and bent, the left knee up."""
    rotations = np.tile(np.eye(3), (13, 1, 1))
    rotations[model.PELVIS] = rotation(y=yaw)
    rotations[model.CHEST] = rotation(x=0.2, y=0.3)
    rotations[model.HEAD] = rotation(y=-0.4)
    rotations[model.UPPER_ARM_L] = rotation(x=-1.5, z=0.1)
    rotations[model.FOREARM_L] = rotation(x=-0.2)
    rotations[model.UPPER_ARM_R] = rotation(z=-1.3)
    rotations[model.FOREARM_R] = rotation(x=-1.1)
    rotations[model.THIGH_L] = rotation(x=-0.9, z=0.1)
    rotations[model.SHIN_L] = rotation(x=1.0)
    posture = Posture(np.array(place), rotations, model.lengths_for_height(height))
    contacts = np.array([0.1, 0.9])
    confidence = np.linspace(0.5, 1.0, 20)
    return Body(id, posture.joints(), confidence, posture.orientations(), contacts, stature=height)


def character(name: str, skeleton: Skeleton) -> Character:
    """Returns a rigged character without a visible surface, as ``character_of`` makes it."""
    above = np.maximum(skeleton.parents, 0)
    vertices = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], np.float32)
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.float32([1, 0, 0, 0]), (3, 1)))
    pivots = skeleton.positions[above].astype(np.float32)
    edges = np.zeros((0, 2), np.int32)
    return Character(
        name, vertices, np.array([[0, 1, 2]]), skin, pivots, edges, "bones", names=skeleton.names
    )


def create_pose(name: str, skeleton: Skeleton, node_turns, place=(0.0, 0.0, 0.0), time_ns: int = 0):
    """Returns the pose of a rig with joints that rotate as nodes of a glTF, and the joints' (N, 3) positions.

    Args:
        node_turns: (N, 4) rotation of each joint relative to its parent, in the axes of the rest pose.
    """
    count = len(skeleton)
    world, joints = np.zeros((count, 4)), np.zeros((count, 3))
    for joint, parent in enumerate(skeleton.parents):
        if parent < 0:
            world[joint], joints[joint] = node_turns[joint], skeleton.positions[joint] + place
        else:
            world[joint] = multiply(world[parent], node_turns[joint])
            joints[joint] = joints[parent] + rotate(world[parent], skeleton.vectors[joint])
    above = np.maximum(skeleton.parents, 0)
    # Transform j is the bone that ends at joint j. It rotates with the parent of joint j.
    linear, positions = to_matrix(world[above]).astype(np.float32), joints[above].astype(np.float32)
    return Pose(name, time_ns, linear, positions), joints


def facing_away(skeleton: Skeleton) -> Skeleton:
    """Returns a skeleton that faces -Z at rest, as the models in VRM 0 files do."""
    return Skeleton(skeleton.names, skeleton.parents, skeleton.positions * [-1.0, 1.0, -1.0])


def some_turns(count: int, seed: int, size: float = 0.9) -> np.ndarray:
    """Returns (count, 4) random rotations of limited size."""
    random = np.random.default_rng(seed)
    return from_rotation_vector(random.uniform(-size, size, (count, 3)))
