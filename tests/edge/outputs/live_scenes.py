"""Frames of a stage with four characters, and outputs that are opened on receivers of loopback."""

from __future__ import annotations

import numpy as np
from made_bodies import horse
from made_people import person
from posed_people import character, performer, posed, some_turns

from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.props import BALL, BOX, Props
from enliven.rotation import from_rotation_vector, rotate, to_matrix
from enliven_edge.outputs.humanoid_map import humanoid_map
from enliven_edge.outputs.live_frame import CharacterInfo, LiveFrame

CHAIR_TURN = from_rotation_vector(np.array([0.3, 0.8, -0.2]))
"""(4,) rotation of the graph character."""
CHAIR_PLACE = np.array([1.5, 0.2, -1.0])
"""(3,) metres, displacement of the graph character."""


def chair() -> tuple[Character, Pose]:
    """Returns a mesh with a deformation graph, rotated and moved as a whole."""
    pivots = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3)).astype(np.float32)
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.float32([1, 0, 0, 0]), (3, 1)))
    edges = np.array([[0, 1]], np.int32)
    mesh = Character("chair", pivots[:3], np.array([[0, 1, 2]]), skin, pivots, edges)
    positions = (rotate(CHAIR_TURN, pivots) + CHAIR_PLACE).astype(np.float32)
    linear = np.tile(to_matrix(CHAIR_TURN), (20, 1, 1)).astype(np.float32)
    return mesh, Pose("chair", 0, linear, positions)


def four_characters(time_ns: int = 10**9) -> LiveFrame:
    """Returns two human rigs, a horse and a chair, with two performers and two loose objects."""
    characters, poses = {}, []
    for name, skeleton, seed in (
        ("anna", person("mixamo"), 1),
        ("ben", person("vrm", np.random.default_rng(2)), 2),
        ("horse", horse(), 3),
    ):
        characters[name] = CharacterInfo(character(name, skeleton), humanoid_map(skeleton))
        poses.append(posed(name, skeleton, some_turns(len(skeleton), seed, 0.4), (seed, 0.0, 0.5))[0])
    mesh, pose = chair()
    characters["chair"] = CharacterInfo(mesh)
    props = Props(
        *(time_ns, np.array([3, 4]), np.array([BOX, BALL], np.uint8), np.full((2, 3), 0.1, np.float32)),
        *(np.zeros((2, 3), np.uint8), np.array([[1.0, 2.0, 3.0], [0.0, 0.5, 0.0]])),
        np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)),
    )
    people = {1: performer(), 2: performer(2, (-1.0, 0.9, -3.0), yaw=-0.5)}
    return LiveFrame(time_ns, people, [*poses, pose], characters, frozenset({"anna"}), props)
