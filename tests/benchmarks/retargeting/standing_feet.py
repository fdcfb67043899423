"""Measures how fast standing feet slide over the floor in a written GLB, independently of the mapping.

The performer's joints come from the motion's file. The model's surface comes from the GLB and is skinned
here. Nothing of ``enliven.mapping`` is used. A foot of the performer stands if one of its joints is low and
slow. The model's feet are its lowest part at rest. The lowest centimetre of a foot touches the floor.

    speeds = standing_slides(Path("run.bvh"), glb_bytes, "mixamo")     # (S,) cm/s in the size of a person
    speeds = standing_leg_slides(Path("run.bvh"), glb_bytes, "Horse")  # the same for each leg of an animal
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pygltflib
from limb_directions import (
    JOINTS,
    SIDES,
    find_convention,
    find_name,
    model_times,
    read_accessor,
    read_motion,
    world_matrices,
)

LEGS = {
    "Horse": {"FFB.L": 0, "FFB.R": 1, "FF.L": 1, "FF.R": 0},
    "Deer": {"FFB.L": 0, "FFB.R": 1, "FF.L": 1, "FF.R": 0},
    "Spider": {
        "BackFoot.L": 0,
        "BackFoot.R": 1,
        "MidBackFoot.L": 1,
        "MidBackFoot.R": 0,
        "MidFrontFoot.L": 0,
        "MidFrontFoot.R": 1,
        "FrontFoot.L": 1,
        "FrontFoot2.R": 0,
    },
    "Trex": {"BackFoot.L": 0, "BackFoot.R": 1},
}
"""The ankles of animals, each with the side of the performer's foot that it follows: 0 is left, 1 right."""
PERSON_M = 1.75
"""Height of a person in metres. Speeds are scaled to this size."""
FOOT_HEIGHT = 0.08
"""Fraction of a model's height that counts as feet at rest, 14 cm for a person."""
PATCH_M = 0.01
"""Maximum height above the lowest point at which a foot touches the floor, metres for a person."""
LOW_M = 0.05
"""Maximum height of a standing foot's joint above its lowest height, metres for a person."""
SLOW_M_S = 0.5
"""Maximum speed of the slowest joint of a standing foot, m/s for a person. Captures are noisy."""
PACE = 0.2
"""Maximum speed as a fraction of the body's speed, for runners, whose feet roll fast."""
MIN_CONTACT_S = 0.06
"""Minimum duration of a contact in seconds. A sprinter's contact lasts 80 ms."""


def standing_slides(motion: Path, glb: bytes, model: str) -> np.ndarray:
    """Returns the speeds (S,) in cm/s of the touching parts of feet, for each frame in which a foot stands.

    Args:
        motion: the file that was retargeted, from its beginning on.
        glb: the written model, which moves over the floor.
        model: the model's naming convention.
    """
    document = pygltflib.GLTF2.load_from_bytes(glb)
    times = model_times(document)
    stands = performer_stands(motion, times)
    spelled = JOINTS[model][-1]
    names = [(node.name or "").split(" to ")[0] for node in document.nodes]
    feet, height = _feet_over_time(document, [find_name(names, spelled, side) for side in SIDES])
    scale, speeds = PERSON_M / height, list[np.ndarray]()
    for side, foot in enumerate(feet):
        speed = patch_speeds(foot * scale, times)
        speeds.append(speed[stands[1:, side] & stands[:-1, side]])
    return 100.0 * np.concatenate(speeds)


def standing_leg_slides(motion: Path, glb: bytes, model: str) -> dict[str, np.ndarray]:
    """Returns the speeds (S,) in cm/s of the touching part of each foot of an animal, by its ankle's name.

    The frames are those in which the performer's foot stands that the foot follows.

    Args:
        motion: the file that was retargeted, from its beginning on.
        glb: the written model, which moves over the floor.
        model: the animal, a key of ``LEGS``.
    """
    document = pygltflib.GLTF2.load_from_bytes(glb)
    times, legs = model_times(document), LEGS[model]
    stands = performer_stands(motion, times)
    feet, height = _feet_over_time(document, list(legs))
    slides = dict[str, np.ndarray]()
    for (name, side), foot in zip(legs.items(), feet, strict=True):
        speed = patch_speeds(foot * PERSON_M / height, times)
        slides[name] = 100.0 * speed[stands[1:, side] & stands[:-1, side]]
    return slides


def patch_speeds(foot: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Returns (T - 1,) m/s along the floor: the median over the vertices (T, V, 3) that are lowest."""
    between = 0.5 * (foot[1:, :, 1] + foot[:-1, :, 1])
    lowest = between < between.min(1, keepdims=True) + PATCH_M
    moved = np.linalg.norm(np.diff(foot, axis=0)[..., [0, 2]], axis=2)
    along = [np.median(some[which]) for some, which in zip(moved, lowest, strict=True)]
    return np.array(along) / np.diff(times)


def performer_stands(motion: Path, times: np.ndarray) -> np.ndarray:
    """Returns (T, 2) True if the performer's left or right foot stands at each of the times (T,)."""
    capture, first = read_motion(motion)
    at = capture.positions[first:]
    height = np.percentile(np.ptp(at[..., 1], axis=1), 90)
    at = at * PERSON_M / height
    names = {name: k for k, name in enumerate(capture.names)}
    spelled = JOINTS[find_convention(names)][-1]
    nearest = np.clip(np.round(times / capture.seconds).astype(int), 0, len(at) - 1)
    way = at[-1, 0] - at[0, 0]
    slow = max(SLOW_M_S, PACE * float(np.hypot(way[0], way[2])) / ((len(at) - 1) * capture.seconds))
    standing = []
    for side in SIDES:
        foot = [names[find_name(names, spelled, side)]]
        for joint, parent in enumerate(capture.parents):
            if parent in foot:
                foot.append(joint)
        joints = at[:, foot]
        speed = np.linalg.norm(np.gradient(joints, capture.seconds, axis=0), axis=2)
        low = joints[..., 1] < np.percentile(joints[..., 1], 5, axis=0) + LOW_M
        standing.append(_remove_short((low & (speed < slow)).any(1), capture.seconds)[nearest])
    return np.stack(standing, axis=1)


def _remove_short(stands: np.ndarray, seconds: float) -> np.ndarray:
    """Returns (F,) the contacts, without those that are too short."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], stands, [False]]).astype(int)))
    kept = np.zeros(len(stands), bool)
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        kept[start:end] = (end - start) * seconds >= MIN_CONTACT_S
    return kept


def _feet_over_time(document: pygltflib.GLTF2, ankles: Sequence[str]) -> tuple[list[np.ndarray], float]:
    """Returns the vertices (T, V, 3) in metres of the foot at each of the ankles, and the model's height."""
    blob, worlds = document.binary_blob(), world_matrices(document)
    skinned = [(node, document.skins[node.skin]) for node in document.nodes if node.skin is not None]
    node, skin = skinned[0]
    inverse = read_accessor(document, blob, skin.inverseBindMatrices).reshape(-1, 4, 4).swapaxes(1, 2)
    at, joints, weights = _read_vertices(document, blob, node.mesh)
    names = {(document.nodes[k].name or "").split(" to ")[0]: n for n, k in enumerate(skin.joints)}
    rest = np.linalg.inv(inverse)[:, :3, 3]
    places = np.array([rest[names[ankle]] for ankle in ankles])
    height, low = np.ptp(at[:, 1]), at[:, 1].min()
    moves = np.stack([worlds[j] @ inverse[n] for n, j in enumerate(skin.joints)], axis=1)
    feet = []
    nearest = np.linalg.norm(at[:, None] - places, axis=2).argmin(1)
    for number in range(len(ankles)):
        foot = np.flatnonzero((nearest == number) & (at[:, 1] < low + FOOT_HEIGHT * height))
        moved = np.zeros((len(moves), len(foot), 3))
        for bones, shares in zip(joints[foot].T, weights[foot].T, strict=True):
            used = moves[:, bones]
            turned = np.einsum("tvij,vj->tvi", used[..., :3, :3], at[foot]) + used[..., :3, 3]
            moved += shares[:, None] * turned
        feet.append(moved)
    return feet, float(height)


def _read_vertices(document: pygltflib.GLTF2, blob: bytes, number: int) -> tuple[np.ndarray, ...]:
    """Returns positions (V, 3), joints (V, 4) and weights (V, 4) of all primitives of a mesh."""
    kinds = ("POSITION", "JOINTS_0", "WEIGHTS_0")
    parts = [
        [read_accessor(document, blob, getattr(primitive.attributes, kind)) for kind in kinds]
        for primitive in document.meshes[number].primitives
    ]
    at, joints, weights = (np.concatenate(some) for some in zip(*parts, strict=True))
    return at, joints.astype(int), weights / weights.sum(1, keepdims=True)
