"""Generates walks and runs of a man whose feet roll from heel to toe, and a model with long shoes."""

from __future__ import annotations

import numpy as np
from made_bodies import man

from enliven.document.character import SkinWeights
from enliven.document.clip import Clip
from enliven.document.rigged import still_shape
from enliven.document.skeleton import Skeleton
from enliven.meshes.mesh import Mesh
from enliven.rotation import from_rotation_vector, rotate

STEP = 1 / 60
"""Seconds between two frames."""
HEEL, TOE = np.array([0.0, -0.09, -0.05]), np.array([0.0, -0.09, 0.17])
"""Heel and toe positions relative to the ankle, metres. The foot rolls about them."""
TOES_UP, TOES_DOWN = np.radians(15.0), np.radians(45.0)
"""Pitch of the foot at landing (toes up) and at lift-off (toes down), radians."""


def gait(speed: float, stance_s: float, swing_s: float, rounds: int = 3) -> tuple[Clip, np.ndarray]:
    """Returns a take of a man that walks along +Z (m/s), and (F, 2) True while his left and right foot stand.

    A standing foot rolls about its heel, lies flat, and rolls about its toes, without sliding. If feet stand
    for less than half of the time, he runs with flight phases.
    """
    skeleton, period = man(), stance_s + swing_s
    times = np.arange(round(rounds * period / STEP)) * STEP
    root = np.tile(skeleton.positions[0] - [0, 0.1, 0], (len(times), 1))
    root[:, 2] = speed * times
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), len(skeleton), 1))
    stands = np.empty((len(times), 2), bool)
    for side, name, begin in ((0, "Left", 0.0), (1, "Right", 0.5)):
        number, into = np.divmod(times + begin * period, period)
        stands[:, side] = into < stance_s
        # A foot lies flat under the hip in the middle of its stance.
        place = (number + 0.5 * stance_s / period - begin) * period * speed
        ankle, pitch = _foot(into, stance_s, swing_s, period * speed)
        hip, knee, end, toe = (skeleton.index(f"{name} {joint}") for joint in ("hip", "knee", "ankle", "toe"))
        goal = ankle + place[:, None] * [0.0, 0.0, 1.0] + [skeleton.positions[end, 0], 0.0, 0.0]
        turns[:, knee], turns[:, end] = _leg(goal - root - (skeleton.positions[hip] - skeleton.positions[0]))
        turns[:, toe] = _about_x(pitch)
    return Clip("gait", skeleton, turns, root, STEP), stands


def sway(roll: float, yaw: float, seconds: float = 2.0) -> Clip:
    """Returns a take of a standing man that rotates his pelvis by up to ``roll`` and ``yaw`` radians."""
    skeleton, times = man(), np.arange(round(seconds / STEP)) * STEP
    root = np.tile(skeleton.positions[0] - [0, 0.05, 0], (len(times), 1))
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), len(skeleton), 1))
    angles = np.stack([0 * times, yaw * np.sin(3.0 * times), roll * np.sin(5.0 * times)], axis=1)
    turns[:, 0] = from_rotation_vector(angles)
    for name in ("Left", "Right"):
        hip, knee, ankle = (skeleton.index(f"{name} {joint}") for joint in ("hip", "knee", "ankle"))
        turns[:, hip] = turns[:, 0]
        hip_place = root + rotate(turns[:, hip], skeleton.vectors[hip])
        turns[:, knee], turns[:, ankle] = _leg(skeleton.positions[ankle] - hip_place)
    return Clip("sway", skeleton, turns, root, STEP)


def _foot(into, stance_s, swing_s, stride):
    """Returns (F, 3) the ankle's offset from its position while the foot is flat, metres, and (F,) the
    downward pitch of the toes, radians.
    """
    share = np.clip(into / stance_s, 0.0, 1.0)
    pitch = TOES_DOWN * np.clip((share - 0.6) / 0.4, 0.0, 1.0) - TOES_UP * np.clip(
        1.0 - share / 0.15, 0.0, 1.0
    )
    swing = np.clip((into - stance_s) / swing_s, 0.0, 1.0)
    eased = swing * swing * (3.0 - 2.0 * swing)
    pitch = np.where(swing > 0.0, TOES_DOWN - (TOES_DOWN + TOES_UP) * eased, pitch)
    about = np.where(pitch[:, None] > 0.0, TOE, HEEL)
    standing = about - rotate(_about_x(pitch), about)
    leaves, lands = (
        p - rotate(_about_x(np.array([a])), p)[0] for p, a in ((TOE, TOES_DOWN), (HEEL, -TOES_UP))
    )
    going = leaves + eased[:, None] * (lands + np.array([0.0, 0.0, stride]) - leaves)
    going[:, 1] += 0.08 * np.sin(np.pi * swing)
    ankle = np.where(swing[:, None] > 0.0, going, standing)
    return ankle - HEEL * [0.0, 1.0, 0.0], pitch


def _leg(way):
    """Returns (F, 4) rotations of thigh and shin that bring the ankle to (F, 3) metres from the hip."""
    skeleton = man()
    upper, lower = (skeleton.lengths[skeleton.index(f"Left {name}")] for name in ("knee", "ankle"))
    rest = [
        np.arctan2(*skeleton.vectors[skeleton.index(f"Left {name}")][[2, 1]] * [1, -1])
        for name in ("knee", "ankle")
    ]
    far = np.minimum(np.linalg.norm(way[:, 1:], axis=1), 0.999 * (upper + lower))
    bend = np.arccos((upper**2 + far**2 - lower**2) / (2 * upper * far))
    beyond = np.arccos((upper**2 + lower**2 - far**2) / (2 * upper * lower)) - np.pi
    slope = np.arctan2(way[:, 2], -way[:, 1]) + bend
    return _about_x(rest[0] - slope), _about_x(rest[1] - slope - beyond)


def _about_x(angles):
    return from_rotation_vector(np.stack([angles, 0 * angles, 0 * angles], 1))


def shod(skeleton: Skeleton, tip: float):
    """Returns a man's mesh in the rest pose with box-shaped shoes that end ``tip`` metres ahead of the
    ankle.
    """
    corners = np.array([[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0.02]])
    at = [point + corner for point in skeleton.positions for corner in corners]
    faces = [[3 * j, 3 * j + 1, 3 * j + 2] for j in range(len(skeleton))]
    bones = np.repeat(np.arange(len(skeleton)), 3).tolist()
    for side in ("Left", "Right"):
        ankle, toe, first = (
            skeleton.positions[skeleton.index(f"{side} ankle")],
            skeleton.index(f"{side} toe"),
            len(at),
        )
        for z in (-0.07, 0.0, tip):
            at += [[ankle[0] + x, y, ankle[2] + z] for x in (-0.05, 0.05) for y in (0.0, 0.06)]
            bones += [toe] * 4
        box = np.array(
            [[0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]]
        )
        faces += [*(box + first).tolist(), *(box + first + 4).tolist()]
    indices = np.zeros((len(at), 4), np.uint16)
    indices[:, 0] = bones
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(at), 1))
    mesh = Mesh(np.array(at, float), np.array(faces, np.int32), "shod")
    return still_shape("shod", skeleton, mesh, SkinWeights(indices, weights))
