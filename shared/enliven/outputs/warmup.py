"""A sample frame that contains each kind of object. Sending it compiles the kernels of the outputs before the
first real frame."""

from __future__ import annotations

import numpy as np

from enliven.document import BOX, Character, Pose, Props, SkinWeights
from enliven.outputs.humanoid_map import HumanoidMap, HumanoidNode
from enliven.outputs.live_frame import CharacterInfo, LiveFrame
from enliven.person import Body, Joint
from enliven.rotation import IDENTITY


def sample_frame() -> LiveFrame:
    """Returns a frame with a performer, a human rig, another rig, a deformation graph and a box."""
    rigs = {"human": ("bones", ("Hips",)), "horse": ("bones", ("Body",)), "chair": ("graph", None)}
    humanoid = HumanoidMap([HumanoidNode("Hips", 0, np.zeros(3), IDENTITY)], 0.0)
    characters, poses = {}, list[Pose]()
    for name, (kind, bones) in rigs.items():
        character = _triangle(name, kind, bones)
        characters[name] = CharacterInfo(character, humanoid if name == "human" else None)
        poses.append(character.rest_pose())
    body = Body(
        *(1, np.zeros((len(Joint), 3)), np.ones(len(Joint)), np.tile(IDENTITY, (len(Joint), 1))),
        *(np.ones(2), 1.75),
    )
    props = Props(
        *(0, np.array([1]), np.array([BOX], np.uint8), np.ones((1, 3), np.float32)),
        *(np.zeros((1, 3), np.uint8), np.zeros((1, 3)), IDENTITY[None]),
    )
    return LiveFrame(0, {1: body}, poses, characters, props=props, world_from_camera=np.eye(4))


def _triangle(name: str, kind: str, bones: tuple[str, ...] | None) -> Character:
    """Returns a character with a single triangle that follows one bone, or the two nodes of a graph."""
    corners = np.eye(3, dtype=np.float32)
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.array([1, 0, 0, 0], np.float32), (3, 1)))
    pivots = corners[: 1 if bones else 2]
    faces, edges = np.array([[0, 1, 2]], np.int32), np.zeros((0, 2), np.int32)
    return Character(name, corners, faces, skin, pivots, edges, kind, names=bones)
