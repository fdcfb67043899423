"""Simulated people that spin and step about, and the headings of people and of the meshes attached to
them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float, Int
from enliven.person.body import Body
from enliven.person.joints import PARENTS, Joint
from enliven.possession import EmbeddedActor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation

FRAME_RATE_HZ = 30.0
MAX_TURN_RATE_DEG_S = 300.0
"""Maximum rate of turning, degrees per second: a pirouette. Faster turns last less than one revolution."""
SEGMENT_S = (0.4, 2.0)
"""Minimum and maximum time for which a simulated person keeps a rate of turning, seconds."""
MAX_HIP_NODES = 10
"""Number of nodes for the mean rotation of a mesh's hips. A person of 128 nodes has about this many."""


def spinning_people(
    seed: int, seconds: float = 8.0, noise_m: float = 0.0, height: float = 1.75
) -> list[Body]:
    """Returns a film of one person, 30 frames per second, that turns both ways while the limbs swing.

    Args:
        noise_m: standard deviation in metres of each coordinate of each joint.
    """
    rng = np.random.default_rng(seed)
    count = round(seconds * FRAME_RATE_HZ)
    yaw = rng.uniform(-np.pi, np.pi) + np.cumsum(_turn_rates(rng, count)) / FRAME_RATE_HZ
    swing = rng.uniform(1.0, 4.0, 4)[:, None] * np.arange(count) / FRAME_RATE_HZ + rng.uniform(0, 6, (4, 1))
    arms, legs = 0.8 + 0.7 * np.sin(swing[:2]), 0.25 + 0.25 * np.sin(swing[2:])
    walk = 0.4 * np.sin(swing[:2] / 2)
    lengths, bodies = model.lengths_for_height(height), []
    for n in range(count):
        rotations = standing_pose(yaw[n], elbow=0.4)
        rotations[model.UPPER_ARM_L], rotations[model.UPPER_ARM_R] = (
            rotation(x=-0.3 * arms[0, n], z=arms[0, n]),
            rotation(x=-0.3 * arms[1, n], z=-arms[1, n]),
        )
        for side, (thigh, shin) in enumerate(((model.THIGH_L, model.SHIN_L), (model.THIGH_R, model.SHIN_R))):
            rotations[thigh] = rotation(x=-legs[side, n]) @ rotations[thigh]
            rotations[shin] = rotation(x=1.5 * legs[side, n])
        place = np.array([walk[0, n], 4 / 7 * height, walk[1, n] - 2.7])
        joints = Posture(place, rotations, lengths).joints() + noise_m * rng.normal(size=(20, 3))
        bodies.append(Body(1, joints, np.ones(20), stature=height))
    return bodies


def _turn_rates(rng: np.random.Generator, count: int) -> Float:
    """Returns (count,) rates in radians per second, each kept for a while, then eased to the next."""
    rates: list[float] = []
    while len(rates) < count:
        kept = round(rng.uniform(*SEGMENT_S) * FRAME_RATE_HZ)
        rates += [math.radians(rng.uniform(-MAX_TURN_RATE_DEG_S, MAX_TURN_RATE_DEG_S))] * kept
    eased = np.convolve(rates, np.hanning(9) / np.hanning(9).sum(), "same")
    return np.asarray(eased[:count])


def hip_heading(joints: Float) -> float:
    """Returns the heading of the hips of (20, 3) joints, radians about +Y from +Z."""
    left = joints[Joint.HIP_LEFT] - joints[Joint.HIP_RIGHT]
    return math.atan2(-left[2], left[0])


def headings_on_stage(
    actor: EmbeddedActor, film: Sequence[Body], held_from: int, parts: str = "all"
) -> tuple[Float, Float]:
    """Returns (F,) heading difference between the mesh's hips and the performer's, radians, and (F, 3)
    positions of the mesh's hips.

    The rotation of the mesh's hips is the mean rotation of its pelvis nodes. The positions are those of the
    mesh's hip centre as moved by these nodes, metres, world.

    Args:
        film: bodies of one performer, one per frame.
        held_from: the frame after which the performer is attached.
    """
    assert actor.likeness is not None
    hips = _hip_nodes(actor)
    arms = actor.likeness.joints[Joint.HIP_CENTER] - actor.graph.positions[hips]
    stage, name = Stage([actor]), actor.character.id
    gaps, places = np.empty(len(film)), np.empty((len(film), 3))
    stage.perform([], 0)  # A tracker reports no people in its first frames.
    for n, body in enumerate(film):
        pose = stage.perform([body], round((n + 1) * 1e9 / FRAME_RATE_HZ))[0]
        turn = pose.linear[hips].astype(np.float64).mean(0)
        mesh = math.atan2(turn[0, 2] - turn[2, 0], turn[0, 0] + turn[2, 2]) + actor.likeness.yaw
        gaps[n] = wrapped(mesh - hip_heading(body.joints))
        places[n] = (pose.positions[hips] + np.einsum("nab,nb->na", pose.linear[hips], arms)).mean(0)
        if n == held_from:
            stage.possess(name, parts=parts)
    return gaps, places


def _hip_nodes(actor: EmbeddedActor) -> Int:
    """Returns the indices of the pelvis nodes. Their nearest bone is a pelvis bone, and they are below the
    middle of the waist.

    Nodes above are excluded because a twist of the chest relative to the hips is spread over the whole belly.
    """
    assert actor.likeness is not None
    nodes, joints = actor.graph.positions, actor.likeness.joints
    apart = np.stack([metres_from_bone(nodes, joints, joint) for joint in range(1, len(Joint))], 1)
    nearest = 1 + np.nan_to_num(apart, nan=np.inf).argmin(1)
    about = np.linalg.norm(nodes - joints[Joint.HIP_CENTER], axis=1)
    up = joints[Joint.SPINE] - joints[Joint.HIP_CENTER]
    low = (nodes - joints[Joint.HIP_CENTER]) @ up < 0.5 * up @ up
    on_pelvis = low & np.isin(nearest, (Joint.SPINE, Joint.HIP_LEFT, Joint.HIP_RIGHT))
    return np.argsort(np.where(on_pelvis, about, np.inf))[: min(MAX_HIP_NODES, max(int(on_pelvis.sum()), 1))]


def metres_from_bone(points: Float, joints: Float, joint: int) -> Float:
    """Returns (P,) the distance from points to the bone that ends in a joint, metres."""
    start, way = joints[PARENTS[joint]], joints[joint] - joints[PARENTS[joint]]
    along = np.clip((points - start) @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - along[:, None] * way, axis=1))


def deviations_deg(gaps: Float) -> Float:
    """Returns (F,) deviations of (F,) angles, in radians, from their circular mean, degrees."""
    mean = math.atan2(np.sin(gaps).sum(), np.cos(gaps).sum())
    return np.degrees(np.abs(wrapped(gaps - mean)))


def wrapped(angle: float | Float) -> Float:
    """Returns angles in radians, wrapped to -pi .. pi."""
    return np.asarray((np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi)
