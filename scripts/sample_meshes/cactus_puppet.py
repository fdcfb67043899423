"""The cactus as a puppet that a tracked person moves.

It consists of control points, and their positions for a few poses of the person.

    project = cactus_project()           # with the puppet "cactus", and the take of the poses

The poses are constructed here from bone directions. They are not recordings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.document import ArapSettings, ControlPoint, ExampleCharacter, KeyPose, Plane, Project
from enliven.motion_clips.joint_positions import clip_of_bodies
from enliven.person import BODY_NAMES, PARENTS, Body, Joint
from sample_meshes.cactus import make_cactus

TAKE = "cactus poses"
_Direction = tuple[float, float, float]

_POINTS: tuple[tuple[str, _Direction, Joint], ...] = (
    ("head", (0.0, 1.33, 0.0), Joint.HEAD),
    ("left temple", (0.13, 1.17, 0.0), Joint.HEAD),
    ("right temple", (-0.13, 1.17, 0.0), Joint.HEAD),
    ("chest", (0.0, 0.84, 0.15), Joint.SHOULDER_CENTER),
    ("back", (0.0, 0.84, -0.15), Joint.SHOULDER_CENTER),
    ("left elbow", (0.44, 0.67, 0.0), Joint.ELBOW_LEFT),
    ("right elbow", (-0.44, 0.67, 0.0), Joint.ELBOW_RIGHT),
    ("left hand", (0.40, 1.10, 0.0), Joint.WRIST_LEFT),
    ("right hand", (-0.40, 1.10, 0.0), Joint.WRIST_RIGHT),
    ("pot", (0.0, 0.22, -0.21), Joint.HIP_CENTER),
    ("left foot", (0.15, 0.0, 0.0), Joint.ANKLE_LEFT),
    ("right foot", (-0.15, 0.0, 0.0), Joint.ANKLE_RIGHT),
)
"""Name, approximate position on the mesh at rest, and paired joint of each control point."""
_SOIL_HEIGHT = 0.25
"""Height in metres above the floor of the mesh's soil, where the trunk leaves the pot."""
_SHOULDER_HEIGHT = 0.64
"""Height in metres above the floor at which the arms leave the trunk."""
_TRUNK_TOP_HEIGHT = 1.33
"""Height in metres above the floor at which the trunk ends."""

_BONE_LENGTHS: Mapping[str, float] = {
    "SPINE": 0.22, "SHOULDER_CENTER": 0.30, "HEAD": 0.22, "SHOULDER": 0.19, "ELBOW": 0.28, "WRIST": 0.25,
    "HAND": 0.08, "HIP": 0.13, "KNEE": 0.42, "ANKLE": 0.40, "FOOT": 0.15,
}  # fmt: skip
"""Lengths of an adult's bones in metres, by the joint at their end."""


@dataclass(frozen=True)
class _Arm:
    """An arm pose.

    It has the directions of the performer's upper arm and forearm, and the positions of the cactus's elbow
    and arm end.
    """

    upper: _Direction
    fore: _Direction
    elbow: _Direction
    end: _Direction


_DOWN = _Arm((0.14, -0.99, 0.0), (0.06, -0.99, 0.1), (0.42, 0.60, 0.02), (0.66, 0.27, 0.08))
_OUT = _Arm((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.46, 0.63, 0.0), (0.88, 0.70, 0.0))
_UP = _Arm((0.25, 0.97, 0.0), (0.05, 1.0, 0.0), (0.44, 0.74, 0.0), (0.37, 1.24, 0.0))
_AHEAD = _Arm((0.05, -0.05, 1.0), (0.0, 0.0, 1.0), (0.36, 0.62, 0.20), (0.33, 0.72, 0.62))
_FORE = _Arm((0.14, -0.99, 0.0), (0.0, -0.1, 1.0), (0.44, 0.62, 0.04), (0.52, 0.54, 0.42))
_BENT = _Arm((0.99, -0.1, 0.0), (0.1, 1.0, 0.0), (0.44, 0.67, 0.0), (0.40, 1.10, 0.0))


@dataclass(frozen=True)
class _Pose:
    """A pose of the performer, with the parameters of the cactus's pose.

    Attributes:
        left, right: the arms.
        lean: radians by which the trunk leans to its left.
        bow: radians by which the trunk bows forward.
        crouch: depth of a knee bend in [0, 1]. It compresses the cactus.
        step: height of the raised left knee in [0, 1]. It tips the pot over its right edge.
    """

    left: _Arm = _DOWN
    right: _Arm = _DOWN
    lean: float = 0.0
    bow: float = 0.0
    crouch: float = 0.0
    step: float = 0.0


_POSES: tuple[_Pose, ...] = (
    _Pose(),
    _Pose(_OUT, _OUT),
    _Pose(_UP, _UP),
    _Pose(_AHEAD, _AHEAD),
    _Pose(_FORE, _FORE),
    _Pose(_BENT, _BENT),
    _Pose(lean=0.5),
    _Pose(bow=0.9),
    _Pose(crouch=1.0),
    _Pose(step=1.0),
)


def cactus_project(cell: float = 0.018) -> Project:
    """Creates a project with the puppet and the take of its poses.

    Args:
        cell: approximate length of an edge of the mesh in metres.
    """
    bodies = [_make_performer(pose) for pose in _POSES]
    take = clip_of_bodies(bodies, np.arange(len(bodies), dtype=np.float64), TAKE, step=1.0)
    mesh = make_cactus(cell)
    near = [int(np.linalg.norm(mesh.vertices - at, axis=1).argmin()) for _, at, _ in _POINTS]
    points = tuple(
        ControlPoint(name, vertex, BODY_NAMES[joint], foot="foot" in name)
        for (name, _, joint), vertex in zip(_POINTS, near, strict=True)
    )
    rest = mesh.vertices[near]
    poses = tuple(KeyPose(TAKE, float(k), _compute_places(pose, rest)) for k, pose in enumerate(_POSES))
    plane = Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    surface = replace(ArapSettings(), hold=0.03)
    puppet = ExampleCharacter("cactus", mesh, points, poses, symmetry=plane, surface=surface)
    return Project().with_takes(take).with_characters(puppet)


def _make_performer(pose: _Pose) -> Body:
    """Returns a person in a pose. The person faces +Z."""
    trunk = _turn(pose.lean, pose.bow)
    ways = {joint: np.array([0.0, 1.0, 0.0]) for joint in Joint}
    for side, name, arm in ((1.0, "LEFT", pose.left), (-1.0, "RIGHT", pose.right)):
        mirror = np.array([side, 1.0, 1.0])
        ways[Joint[f"SHOULDER_{name}"]] = mirror * [0.94, -0.34, 0.0]
        ways[Joint[f"ELBOW_{name}"]] = mirror * arm.upper
        ways[Joint[f"WRIST_{name}"]] = ways[Joint[f"HAND_{name}"]] = mirror * arm.fore
    for joint in list(ways):
        ways[joint] = trunk @ ways[joint]
    for side, name, lifted in ((1.0, "LEFT", pose.step), (-1.0, "RIGHT", 0.0)):
        mirror, knee = np.array([side, 1.0, 1.0]), max(pose.crouch, lifted)
        ways[Joint[f"HIP_{name}"]] = mirror * [0.77, -0.64, 0.0]
        ways[Joint[f"KNEE_{name}"]] = mirror * [0.06 + 0.2 * pose.crouch, -1.0 + 0.75 * knee, 0.9 * knee]
        ways[Joint[f"ANKLE_{name}"]] = mirror * [0.0, -1.0 + 0.3 * pose.crouch, -0.7 * pose.crouch]
        ways[Joint[f"FOOT_{name}"]] = mirror * [0.1, -0.5, 0.86]
    joints = np.zeros((len(Joint), 3))
    for joint, parent in zip(Joint, PARENTS, strict=True):
        if parent >= 0:
            way = ways[joint] / np.linalg.norm(ways[joint])
            name = joint.name
            length = _BONE_LENGTHS.get(name) or _BONE_LENGTHS[name.rsplit("_", 1)[0]]
            joints[joint] = joints[parent] + length * way
    joints[:, 1] -= joints[:, 1].min()
    return Body(0, joints, np.ones(len(Joint)))


def _compute_places(pose: _Pose, rest: Float) -> Float:
    """Returns (P, 3) the positions of the control points in a pose in metres."""
    places = rest.copy()
    arms = {"left": (pose.left, 1.0), "right": (pose.right, -1.0)}
    for k, (name, _, _) in enumerate(_POINTS):
        side, _, part = name.partition(" ")
        if part in ("elbow", "hand"):
            arm, sign = arms[side]
            at = np.array(arm.elbow if part == "elbow" else arm.end) * [sign, 1.0, 1.0]
            places[k] = _place_on_trunk(pose, at, _SHOULDER_HEIGHT)
        elif part != "foot" and side != "pot":
            places[k] = _place_on_trunk(pose, rest[k], rest[k, 1])
    if pose.step:
        edge = np.array([-0.15, 0.0, 0.0])
        places = (places - edge) @ _turn(-0.42 * pose.step, 0.0).T + edge
    return places


def _place_on_trunk(pose: _Pose, at: Float, height: float) -> Float:
    """Returns (3,) the position in metres of a point that moves with the trunk at a height.

    The trunk is bent and compressed by the pose.
    """
    share = (height - _SOIL_HEIGHT) / (_TRUNK_TOP_HEIGHT - _SOIL_HEIGHT)
    pressed = 1.0 - 0.36 * pose.crouch
    lean, bow = 1.2 * pose.lean * share, 1.1 * pose.bow * share
    # The trunk is an arc of constant curvature. The direction at its middle has half the rotation of its end.
    centre = _turn(0.5 * lean, 0.5 * bow) @ np.array([0.0, (height - _SOIL_HEIGHT) * pressed, 0.0])
    beside = (at - [0.0, height, 0.0]) * [1.0 + 0.15 * pose.crouch, pressed, 1.0 + 0.15 * pose.crouch]
    return np.asarray(centre + [0.0, _SOIL_HEIGHT, 0.0] + _turn(lean, bow) @ beside)


def _turn(lean: float, bow: float) -> Float:
    """Returns the (3, 3) rotation that leans to +X and bows to +Z."""
    c, s = np.cos(lean), np.sin(lean)
    a, b = np.cos(bow), np.sin(bow)
    over = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    ahead = np.array([[1.0, 0.0, 0.0], [0.0, a, -b], [0.0, b, a]])
    return np.asarray(over @ ahead)
