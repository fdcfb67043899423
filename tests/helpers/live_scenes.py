"""Frames of a stage with four characters, and outputs that send to receivers on loopback."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from made_bodies import horse
from made_people import person
from posed_people import character, create_pose, performer, some_turns

from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.props import BALL, BOX, Props
from enliven.outputs.humanoid_map import humanoid_map
from enliven.outputs.live_frame import CharacterInfo, LiveFrame
from enliven.person import Body
from enliven.rotation import from_rotation_vector, normalized, rotate, to_matrix

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
        poses.append(create_pose(name, skeleton, some_turns(len(skeleton), seed, 0.4), (seed, 0.0, 0.5))[0])
    mesh, pose = chair()
    characters["chair"] = CharacterInfo(mesh)
    props = Props(
        *(time_ns, np.array([3, 4]), np.array([BOX, BALL], np.uint8), np.full((2, 3), 0.1, np.float32)),
        *(np.zeros((2, 3), np.uint8), np.array([[1.0, 2.0, 3.0], [0.0, 0.5, 0.0]])),
        np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)),
    )
    people = {1: performer(), 2: performer(2, (-1.0, 0.9, -3.0), yaw=-0.5)}
    return LiveFrame(time_ns, people, [*poses, pose], characters, frozenset({"anna"}), props)


def random_body(random: np.random.Generator, number: int) -> Body:
    """Returns a body with random joints, sometimes without orientations, contacts and height."""
    turns = normalized(random.normal(size=(20, 4))) if random.random() < 0.7 else None
    contacts = random.random(2) if random.random() < 0.7 else None
    stature = float(random.uniform(1, 2)) if random.random() < 0.7 else None
    return Body(number, random.uniform(-3, 3, (20, 3)), random.random(20), turns, contacts, stature)


def random_frame(seed: int) -> LiveFrame:
    """Returns a stage with some of the four characters in random poses, performers and loose objects."""
    random = np.random.default_rng(seed)
    base = four_characters()
    poses = []
    for pose in base.poses:
        if random.random() < 0.8:
            linear = to_matrix(normalized(random.normal(size=(len(pose.linear), 4)))).astype(np.float32)
            places = random.uniform(-4, 4, pose.positions.shape).astype(np.float32)
            poses.append(replace(pose, linear=linear, positions=places))
    people = {int(n): random_body(random, int(n)) for n in random.choice(9, random.integers(4), False) + 1}
    count = int(random.integers(4))
    props = Props(
        *(0, random.choice(50, count, False), random.choice([BOX, BALL], count).astype(np.uint8)),
        *(random.random((count, 3), np.float32), random.integers(0, 255, (count, 3)).astype(np.uint8)),
        *(random.uniform(-2, 2, (count, 3)), normalized(random.normal(size=(count, 4)))),
    )
    held = frozenset(pose.character for pose in poses if random.random() < 0.5)
    used = {pose.character: base.characters[pose.character] for pose in poses}
    return LiveFrame(int(random.integers(10**12)), people, poses, used, held, props if count else None)
