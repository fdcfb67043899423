"""Computes angles between the limbs of a written GLB and the performer's limbs, independently of the mapping.

Positions are read from the files alone: the performer's joints from the motion's reader, the model's nodes by
forward kinematics from the GLB's content. The joint names of elbows and so on are listed here for each naming
convention; ``enliven.mapping`` is not used. One constant yaw is removed from each pair.

    errors = limb_errors(Path("walk.bvh"), glb_bytes, "mixamo")     # {"upper arm": (F * 2,) degrees, ...}
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pygltflib

from enliven.formats.motion.bvh import read_bvh
from enliven.formats.motion.capture import Capture
from enliven.formats.motion.expmap import read_expmap
from enliven.motion_clips.take_files import read_take

SEGMENTS = {"upper arm": (0, 1), "forearm": (1, 2), "thigh": (3, 4), "shin": (4, 5)}
"""Limb segments, as pairs of columns of ``JOINTS``."""
JOINTS: dict[str, tuple[str, ...]] = {
    "mixamo": (
        "mixamorig:{Left}Arm",
        "mixamorig:{Left}ForeArm",
        "mixamorig:{Left}Hand",
        "mixamorig:{Left}UpLeg",
        "mixamorig:{Left}Leg",
        "mixamorig:{Left}Foot",
    ),
    "quaternius": (
        "UpperArm.{L}",
        "LowerArm.{L}",
        "Hand.{L}|Palm.{L}|Fist.{L}",
        "UpperLeg.{L}",
        "LowerLeg.{L}",
        "Foot.{L}|LowerLeg.{L}_end",
    ),
    "cryptovoxels": (
        "{Left} arm|{left}UpperArm",
        "{Left} elbow|{left}LowerArm",
        "{Left} wrist|{left}Hand",
        "{Left} leg|{left}UpperLeg",
        "{Left} knee|{left}LowerLeg",
        "{Left} ankle|{left}Foot",
    ),
    "brainstem": (
        "joint 13/joint 18",
        "joint 14/joint 19",
        "joint 15/joint 19 end",
        "joint 4/joint 8",
        "joint 5/joint 9",
        "joint 6/joint 10",
    ),
    "khronos": (
        "joint 16/joint 13",
        "joint 17/joint 14",
        "joint 18/joint 15",
        "joint 7/joint 3",
        "joint 8/joint 4",
        "joint 9/joint 5",
    ),
    "bandai": ("UpperArm_{L}", "LowerArm_{L}", "Hand_{L}", "UpperLeg_{L}", "LowerLeg_{L}", "Foot_{L}"),
    "cmu": ("{Left}Arm", "{Left}ForeArm", "{Left}Hand", "{Left}UpLeg", "{Left}Leg", "{Left}Foot"),
    "biovision": ("{Left}Shoulder", "{Left}Elbow", "{Left}Wrist", "{Left}Hip", "{Left}Knee", "{Left}Ankle"),
    "mocapnet": ("{l}Shldr|{l}shoulder", "{l}elbow", "{l}hand", "{l}hip", "{l}knee", "{l}foot"),
}
"""Shoulder, elbow, wrist, hip, knee and ankle of one side in each naming convention; alternatives after a
bar. After a slash, the name on the right side."""
SIDES = (
    {"Left": "Left", "left": "left", "L": "L", "l": "l"},
    {"Left": "Right", "left": "right", "L": "R", "l": "r"},
)
"""Spellings of the left and the right side."""
YAWS = np.radians(np.arange(-180.0, 180.0, 0.5))
"""Rotations about +Y that are tried as the constant yaw between the two."""


def limb_errors(motion: Path, glb: bytes, model: str) -> dict[str, np.ndarray]:
    """Returns the angles (F * 2,), degrees, between the limbs of both, for each segment, left and right.

    Args:
        motion: the file that was retargeted, from its beginning on.
        glb: the retargeting result.
        model: the model's naming convention.
    """
    capture, first = read_motion(motion)
    times, nodes = node_places(glb)
    frames = np.clip(first + np.round(times / capture.seconds).astype(int), 0, len(capture.positions) - 1)
    names = {name: k for k, name in enumerate(capture.names)}
    theirs = _compute_directions(
        {name: capture.positions[frames, k] for name, k in names.items()}, find_convention(names)
    )
    ours = _compute_directions(nodes, model)
    yaw = _fit_yaw(ours, theirs)
    return {
        segment: np.degrees(
            np.concatenate([_compute_angles(ours[segment, s], theirs[segment, s], yaw) for s in (0, 1)])
        )
        for segment in SEGMENTS
    }


def read_motion(motion: Path) -> tuple[Capture, int]:
    """Returns the motion of a file, and the frame at which its take begins.

    A T-pose that was added at the start is not part of the take.
    """
    capture = read_expmap(motion) if motion.suffix == ".txt" else read_bvh(motion)
    return capture, capture.frames - len(read_take(motion)[0].turns)


def find_convention(names: dict[str, int]) -> str:
    """Returns the first naming convention with all joints present."""
    for convention in ("bandai", "cmu", "biovision", "mocapnet"):
        if all(find_name(names, spelled, SIDES[0]) for spelled in JOINTS[convention]):
            return convention
    raise ValueError(f"no known convention: {sorted(names)[:12]}")


def find_name(names, spelled: str, side: dict[str, str]) -> str:
    """Returns the first alternative name that exists, or an empty string."""
    own = spelled.split("/")[-1 if side is SIDES[1] else 0]
    return next((name for name in own.format(**side).split("|") if name in names), "")


def _compute_directions(places: dict[str, np.ndarray], convention: str) -> dict[tuple[str, int], np.ndarray]:
    """Returns (F, 3) unit vectors along each (segment, side)."""
    directions = {}
    for number, side in enumerate(SIDES):
        at = [places[find_name(places, spelled, side)] for spelled in JOINTS[convention]]
        for segment, (start, end) in SEGMENTS.items():
            along = at[end] - at[start]
            directions[segment, number] = along / np.linalg.norm(along, axis=1, keepdims=True)
    return directions


def _compute_angles(ours: np.ndarray, theirs: np.ndarray, yaw: float) -> np.ndarray:
    """Returns (F,) angles between directions, radians, after rotating ``theirs`` by a yaw."""
    return np.arccos(np.clip(np.sum(ours * _turn_directions(theirs, yaw), axis=1), -1.0, 1.0))


def _turn_directions(vectors: np.ndarray, yaw: float) -> np.ndarray:
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y, z = vectors.T
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=1)


def _fit_yaw(ours: dict[tuple[str, int], np.ndarray], theirs: dict[tuple[str, int], np.ndarray]) -> float:
    """Returns the constant rotation about +Y that minimises the sum of angles over all segments."""
    own, other = (np.concatenate([some[key] for key in sorted(some)]) for some in (ours, theirs))
    return float(min(YAWS, key=lambda yaw: _compute_angles(own, other, yaw).sum()))


def node_places(glb: bytes) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Returns (T,) seconds, and (T, 3) positions in metres of each node of a GLB by name, over its only
    animation.

    A node "A to B" of the exporter begins at joint A, so it is also listed as A.
    """
    document = pygltflib.GLTF2.load_from_bytes(glb)
    worlds, places = world_matrices(document), dict[str, np.ndarray]()
    for k, node in enumerate(document.nodes):
        for name in (node.name or f"node {k}", (node.name or "").split(" to ")[0]):
            places.setdefault(name, worlds[k][:, :3, 3])
    return model_times(document), places


def model_times(document: pygltflib.GLTF2) -> np.ndarray:
    """Returns (T,) seconds of the keys of a GLB's one animation."""
    blob = document.binary_blob()
    samplers = document.animations[0].samplers
    return max((read_accessor(document, blob, s.input)[:, 0] for s in samplers), key=len)


def world_matrices(document: pygltflib.GLTF2) -> list[np.ndarray]:
    """Returns (T, 4, 4) world_from_node of each node of a GLB over its one animation."""
    blob, nodes, times = document.binary_blob(), document.nodes, model_times(document)
    animation, tracks = document.animations[0], {}
    for channel in animation.channels:
        sampler = animation.samplers[channel.sampler]
        keys, values = (read_accessor(document, blob, k) for k in (sampler.input, sampler.output))
        tracks[channel.target.node, channel.target.path] = _sample_values(times, keys[:, 0], values)
    parents = {child: k for k, node in enumerate(nodes) for child in node.children or []}
    worlds: dict[int, np.ndarray] = {}

    def world(k: int) -> np.ndarray:
        if k not in worlds:
            own = _compute_local(nodes[k], k, tracks, len(times))
            worlds[k] = world(parents[k]) @ own if k in parents else own
        return worlds[k]

    return [world(k) for k in range(len(nodes))]


def read_accessor(document: pygltflib.GLTF2, blob: bytes, number: int) -> np.ndarray:
    """Returns (N, W) the numbers of an accessor as floats."""
    accessor = document.accessors[number]
    view = document.bufferViews[accessor.bufferView]
    start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor.type]
    kind = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}[accessor.componentType]
    return np.frombuffer(blob, kind, accessor.count * width, start).reshape(-1, width).astype(float)


def _sample_values(times: np.ndarray, keys: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Returns the values at the times by linear interpolation. Neighbouring quaternions are close, so they
    are only normalised.
    """
    sampled = np.stack([np.interp(times, keys, column) for column in values.T], axis=1)
    return sampled / np.linalg.norm(sampled, axis=1, keepdims=True) if values.shape[1] == 4 else sampled


def _compute_local(node: pygltflib.Node, number: int, tracks: dict, count: int) -> np.ndarray:
    """Returns (T, 4, 4) transforms of a node relative to its parent."""
    matrices = np.tile(np.eye(4), (count, 1, 1))
    turn = tracks.get((number, "rotation"), np.tile(node.rotation or [0.0, 0.0, 0.0, 1.0], (count, 1)))
    x, y, z, w = turn.T
    matrices[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], 1)
    matrices[:, 1, :3] = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], 1)
    matrices[:, 2, :3] = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], 1)
    matrices[:, :3, :3] *= tracks.get((number, "scale"), np.tile(node.scale or [1.0] * 3, (count, 1)))[
        :, None
    ]
    matrices[:, :3, 3] = tracks.get(
        (number, "translation"), np.tile(node.translation or [0.0] * 3, (count, 1))
    )
    return matrices
