"""Swaying performers, without an edge: their bodies, their take, and a chair that they possess."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from sample_meshes.chair import make_chair

from enliven.document import BodyTake, HoldChange, Project
from enliven.oneshot.possession import possess
from enliven.person import Body, Joint
from enliven.possession import ActorSettings
from enliven.possession.likeness.standing_person import make_standing_figure
from enliven.rotation import from_rotation_vector, rotate

STEP_NS = 33_333_333
"""Nanoseconds between two frames."""
_LIMBS = {
    Joint.KNEE_LEFT: (Joint.ANKLE_LEFT, Joint.FOOT_LEFT),
    Joint.ELBOW_LEFT: (Joint.WRIST_LEFT, Joint.HAND_LEFT),
    Joint.ELBOW_RIGHT: (Joint.WRIST_RIGHT, Joint.HAND_RIGHT),
}


def swaying(id: int, frame: int, seed: int = 0, place=(0.0, -2.5)) -> Body:
    """Returns a performer that steps back and forth, bows and swings the limbs, at 30 frames per second."""
    random, t = np.random.default_rng(seed + 7 * id), frame / 30
    joints = make_standing_figure(1.7 + 0.05 * id)
    for middle, ends in _LIMBS.items():
        turn = from_rotation_vector(0.6 * np.sin(3 * t + random.uniform(0, 6)) * random.normal(size=3))
        joints[list(ends)] = joints[middle] + rotate(turn, joints[list(ends)] - joints[middle])
    bow = from_rotation_vector(np.array([0.3 * np.sin(2 * t + random.uniform(0, 6)), 0.2 * np.sin(t), 0.0]))
    upper = [j for j in Joint if joints[j, 1] > joints[Joint.HIP_CENTER, 1]]
    joints[upper] = joints[Joint.HIP_CENTER] + rotate(bow, joints[upper] - joints[Joint.HIP_CENTER])
    joints[:, 0] += place[0] + 0.15 * np.sin(1.5 * t)
    joints[:, 2] += place[1] + 0.1 * np.sin(t + seed)
    return Body(id, joints, np.clip(1.0 + 0.3 * random.normal(size=20), 0.05, 1.0), stature=1.7 + 0.05 * id)


def take_of(frames: int = 30, people=(1,), seed: int = 0, place=(0.0, 0.0)) -> BodyTake:
    """Returns a take of performers that sway about a floor position in metres."""
    bodies = [[swaying(who, n, seed, place) for who in people] for n in range(frames)]
    return BodyTake(
        "sway",
        np.arange(frames) * STEP_NS * 1e-9,
        np.array(people),
        np.array([[body.joints for body in row] for row in bodies]),
        np.array([[body.confidence for body in row] for row in bodies]),
        np.ones((frames, len(people)), bool),
        np.array([[body.stature for body in row] for row in bodies]),
    )


def possessed_chair(
    frames: int = 30, nodes: int = 40, seed: int = 0, holds=(HoldChange(0.1),), **settings
) -> tuple[Project, str]:
    """Returns a coarse chair moved by a performer inside it."""
    how = ActorSettings(**{"place": "fixed", "fade": 0.1} | settings)
    chair = replace(make_chair(0.06), name="chair")
    return possess(chair, take_of(frames, seed=seed), nodes=nodes, holds=holds, settings=how)


def without_cache(project, name):
    """Returns the project with damaged cached motion: every stream of a character is constant."""
    shape = project.graph(name)
    parts = [replace(part, possession=replace(part.possession, solved="")) for part in shape.parts]
    streams = dict(project.streams)
    for part in parts:
        stream = streams[part.take]
        count = stream.positions.shape[1]
        still = np.zeros((1, count, 3)), np.tile(np.eye(3), (1, count, 1, 1))
        streams[part.take] = replace(stream, positions=still[0], linear=still[1])
    return replace(
        project,
        streams=streams,
        characters={**project.characters, name: shape.with_changes(parts=tuple(parts))},
    )
