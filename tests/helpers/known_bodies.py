"""Ten human-like meshes with known joints. Their proportions, poses and styles differ from tracked people.

Each is generated from a posture of the tracker's body model with individual lengths: tapered capsules blended
into one surface, or loose boxes and shells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from sample_meshes.isosurface import surface_of

from enliven.arrays import Float
from enliven.meshes.mesh import Mesh
from enliven.person.joints import PARENTS, Joint
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture, rotation

Capsule = tuple[Float, Float, float, float]
"""The two end points, and the radius at each, metres."""
_FINGERS = (
    (-0.035, 0.0, 0.09),
    (-0.012, 0.0, 0.10),
    (0.012, 0.0, 0.095),
    (0.035, 0.0, 0.08),
    (0.05, 0.0, 0.03),
)
"""Position of each fingertip relative to the hand joint, metres: across, forward and along the hand."""


@dataclass(frozen=True)
class KnownBody:
    """A mesh with known limbs.

    Attributes:
        mesh: metres.
        joints: (20, 3) positions of a person's joints in it, metres.
    """

    mesh: Mesh
    joints: Float


def posed(
    scale: dict[int, float] | None = None,
    arms: tuple[tuple[float, float, float], tuple[float, float, float]] = ((0.0, 0.0, 0.1), (0.0, 0.0, 0.1)),
    elbows: tuple[float, float] = (0.1, 0.1),
    legs: tuple[float, float] = (0.0, 0.1),
    knees: float = 0.05,
    yaw: float = 0.0,
    height: float = 1.75,
) -> Float:
    """Returns (20, 3) metres: a posture of the body model, with its soles near y = 0.

    Args:
        scale: factors on the model's lengths, by the index of the length.
        arms: rotation of the (left, right) upper arm about x, y and z (outward) from hanging, radians.
        elbows: radians, left and right.
        legs: angles by which both thighs are lifted forward, and apart, radians.
        knees: radians.
    """
    lengths = model.lengths_for_height(height)
    for number, factor in (scale or {}).items():
        lengths[number] *= factor
    rotations = np.tile(np.eye(3), (13, 1, 1))
    rotations[model.PELVIS] = rotation(y=yaw)
    for side, upper, fore, thigh, shin in (
        (1, model.UPPER_ARM_L, model.FOREARM_L, model.THIGH_L, model.SHIN_L),
        (-1, model.UPPER_ARM_R, model.FOREARM_R, model.THIGH_R, model.SHIN_R),
    ):
        x, y, z = arms[0 if side > 0 else 1]
        rotations[upper] = rotation(x=x, y=side * y, z=side * z)
        rotations[fore] = rotation(x=-elbows[0 if side > 0 else 1])
        rotations[thigh] = rotation(x=-legs[0], z=side * legs[1])
        rotations[shin] = rotation(x=knees)
    joints = Posture(np.zeros(3), rotations, lengths).joints()
    return joints - [0.0, joints[:, 1].min() - 0.04, 0.0]


def offset_point(point: Float, x: float, y: float, z: float) -> Float:
    """Returns (3,) a point moved by (x, y, z), metres."""
    return np.asarray(point + np.array([x, y, z]))


def limb_capsules(joints: Float, girth: float = 1.0, fingers: bool = False) -> list[Capsule]:
    """Returns capsules around a person's bones."""
    radii = {
        "SPINE": (0.12, 0.11), "SHOULDER_CENTER": (0.11, 0.08), "HEAD": (0.06, 0.10),
        "SHOULDER": (0.07, 0.062),
        "ELBOW": (0.058, 0.042), "WRIST": (0.042, 0.03), "HAND": (0.035, 0.035), "HIP": (0.11, 0.095),
        "KNEE": (0.088, 0.058), "ANKLE": (0.055, 0.042), "FOOT": (0.045, 0.035),
    }  # fmt: skip
    capsules: list[Capsule] = []
    for joint in list(Joint)[1:]:
        first, last = radii[joint.name.removesuffix("_LEFT").removesuffix("_RIGHT")]
        capsules.append((joints[PARENTS[joint]], joints[joint], girth * first, girth * last))
    crown = joints[Joint.HEAD] + 0.25 * (joints[Joint.HEAD] - joints[Joint.SHOULDER_CENTER])
    capsules.append((joints[Joint.HEAD], crown, girth * 0.10, girth * 0.09))
    for hand, side in ((Joint.HAND_LEFT, 1), (Joint.HAND_RIGHT, -1)):
        way = joints[hand] - joints[hand - 1]
        way = way / np.linalg.norm(way)
        ahead = np.cross(way, [0.0, 1.0, 0.0] if abs(way[1]) < 0.9 else [1.0, 0.0, 0.0])
        ahead /= np.linalg.norm(ahead)
        for across, out, along in _FINGERS if fingers else ():
            tip = joints[hand] + across * ahead + along * way + out * side * np.cross(ahead, way)
            capsules.append((joints[hand] + 0.6 * across * ahead, tip, 0.014, 0.012))
    return capsules


def blend_capsules(capsules: list[Capsule], soft: float = 0.02) -> Callable[[Float], Float]:
    """Returns the signed distance to the union of capsules. ``soft`` is the blend radius of the smooth union,
    metres.
    """

    def field(points: Float) -> Float:
        near = np.stack([_to_capsule(points, *capsule) for capsule in capsules])
        least = near.min(0)
        return np.asarray(least - soft * np.log(np.exp(-(near - least) / soft).sum(0)))

    return field


def _to_capsule(points: Float, a: Float, b: Float, first: float, last: float) -> Float:
    """Returns (N,) the distance from points to a tapered capsule, metres, negative inside."""
    way = b - a
    share = np.clip((points - a) @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
    return np.asarray(
        np.linalg.norm(points - a - share[:, None] * way, axis=1) - (first + share * (last - first))
    )


def extract_surface_of_capsules(
    name: str, capsules: list[Capsule], cell: float = 0.03, soft: float = 0.02
) -> Mesh:
    """Returns the surface of blended capsules."""
    ends = np.array([[a, b] for a, b, _, _ in capsules]).reshape(-1, 3)
    wide = max(max(c[2], c[3]) for c in capsules) + 3 * soft + 2 * cell
    return Mesh(
        *surface_of(blend_capsules(capsules, soft), ends.min(0) - wide, ends.max(0) + wide, cell), name
    )


def box(a: Float, b: Float, wide: float, deep: float) -> Mesh:
    """Returns a box around a bone, subdivided into small triangles."""
    axis = (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
    side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    ahead = np.cross(side, axis)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (0, 1) for z in (-1, 1)], float)
    points = (
        a + corners[:, :1] * wide / 2 * side + corners[:, 1:2] * (b - a) + corners[:, 2:] * deep / 2 * ahead
    )
    faces = [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]  # fmt: skip
    mesh = Mesh(points, np.array(faces, np.int32)[:, ::-1].copy())
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    volume = float(np.einsum("fi,fi->", a, np.cross(b, c)))
    return mesh if volume > 0 else Mesh(points, mesh.faces[:, ::-1].copy())


def join_shells(name: str, meshes: list[Mesh]) -> Mesh:
    """Returns several shells as one mesh."""
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + start for m, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces).astype(np.int32), name)


def ball(centre: Float, radii: tuple[float, float, float], name: str = "", cell: float = 0.03) -> Mesh:
    """Returns an ellipsoid."""
    size = np.array(radii)
    vertices, faces = surface_of(
        lambda p: np.linalg.norm(p, axis=1) - 1.0, np.full(3, -1.2), np.full(3, 1.2), cell / size.min()
    )
    return Mesh(vertices * size + centre, faces, name)


def a_pose() -> KnownBody:
    """Returns a tall man with fingers, in an A-pose."""
    joints = posed({model.THIGH: 1.06, model.SHIN: 1.06}, arms=((0.1, 0.0, 0.75),) * 2, height=1.85)
    return KnownBody(
        extract_surface_of_capsules("a-pose", limb_capsules(joints, 1.05, fingers=True), 0.03, 0.012), joints
    )


def t_pose() -> KnownBody:
    """Returns a man with level arms and legs apart."""
    joints = posed(arms=((0.0, 0.0, 1.5708),) * 2, elbows=(0.02, 0.02), legs=(0.0, 0.25))
    return KnownBody(extract_surface_of_capsules("t-pose", limb_capsules(joints)), joints)


def t_woman() -> KnownBody:
    """Returns a slim woman with level arms, fingers, a bun, a bosom, and feet that point down."""
    scale = {model.SHOULDER: 0.86, model.HIP: 1.15, model.ARM: 0.95, model.FORE: 0.95}
    joints = posed(scale, arms=((0.0, 0.0, 1.5708),) * 2, elbows=(0.0, 0.0), legs=(0.0, 0.06), height=1.66)
    shapes = limb_capsules(joints, 0.82, fingers=True)
    bun = offset_point(joints[Joint.HEAD], 0.0, 0.07, -0.11)
    shapes.append((bun, offset_point(bun, 0.0, 0.03, -0.02), 0.05, 0.04))
    chest = offset_point(joints[Joint.SHOULDER_CENTER], 0.0, -0.17, 0.075)
    shapes += [
        (offset_point(chest, s * 0.06, 0, 0), offset_point(chest, s * 0.07, -0.01, 0.015), 0.05, 0.045)
        for s in (-1, 1)
    ]
    return KnownBody(extract_surface_of_capsules("t-woman", shapes, 0.03, 0.012), joints)


def sitting() -> KnownBody:
    """Returns a man that sits upright without a chair, with level thighs and forward forearms."""
    joints = posed(arms=((-0.35, 0.0, 0.25),) * 2, elbows=(1.2, 1.2), legs=(1.5, 0.15), knees=1.45)
    return KnownBody(extract_surface_of_capsules("sitting", limb_capsules(joints), 0.025, 0.012), joints)


def one_arm_up() -> KnownBody:
    """Returns a figure with the right arm overhead and the left one hanging. It is rotated, which is unusual
    for modelled meshes.
    """
    joints = posed(arms=((0.0, 0.0, 0.25), (-0.2, 0.0, 2.85)), elbows=(0.2, 0.15), yaw=0.5)
    return KnownBody(extract_surface_of_capsules("one-arm-up", limb_capsules(joints)), joints)


def robot() -> KnownBody:
    """Returns loose boxes with gaps between them, square hands and broad shoulders."""
    scale = {model.SHOULDER: 1.35, model.HIP: 1.3, model.THIGH: 0.85, model.NECK: 0.9}
    joints = posed(scale, arms=((0.0, 0.0, 0.3),) * 2, elbows=(0.0, 0.0), legs=(0.0, 0.05))
    sizes = {
        "ELBOW": (0.11, 0.12),
        "WRIST": (0.12, 0.13),
        "HAND": (0.13, 0.09),
        "KNEE": (0.15, 0.16),
        "ANKLE": (0.14, 0.15),
    }
    parts = [box(offset_point(joints[0], 0, -0.08, 0), offset_point(joints[0], 0, 0.07, 0), 0.36, 0.2)]
    parts.append(
        box(offset_point(joints[0], 0, 0.085, 0), joints[Joint.SHOULDER_CENTER] - [0, 0.06, 0], 0.44, 0.26)
    )
    parts.append(box(joints[Joint.SHOULDER_CENTER] - [0, 0.05, 0], joints[Joint.SHOULDER_CENTER], 0.12, 0.12))
    parts.append(
        box(joints[Joint.HEAD] - [0, 0.16, 0], offset_point(joints[Joint.HEAD], 0, 0.12, 0), 0.26, 0.24)
    )
    for name, (wide, deep) in sizes.items():
        for side in ("LEFT", "RIGHT"):
            child = Joint[f"{name}_{side}"]
            way = joints[child] - joints[PARENTS[child]]
            gap = 0.008 * way / np.linalg.norm(way)
            longer = 1.9 if name == "HAND" else 1.0
            parts.append(
                box(joints[PARENTS[child]] + gap, joints[PARENTS[child]] + longer * way - gap, wide, deep)
            )
    for side in ("LEFT", "RIGHT"):
        ankle = joints[Joint[f"ANKLE_{side}"]]
        parts.append(
            box(offset_point(ankle, 0, -0.04, -0.08), offset_point(ankle, 0, -0.04, 0.2), 0.15, 0.07)
        )
    return KnownBody(join_shells("robot", parts), joints)


def teddy() -> KnownBody:
    """Returns a bear with a large head, ears, almost no neck and short thick limbs."""
    scale = {
        model.NECK: 1.35, model.ARM: 0.62, model.FORE: 0.55, model.THIGH: 0.45, model.SHIN: 0.4,
        model.HIP: 1.3,
        model.FOOT: 1.1, model.SPINE_LOW: 1.2,
    }  # fmt: skip
    joints = posed(scale, arms=((-0.3, 0.0, 0.9),) * 2, elbows=(0.3, 0.3), legs=(0.1, 0.2), height=1.2)
    head, chest = joints[Joint.HEAD], joints[Joint.SHOULDER_CENTER]
    shapes: list[Capsule] = [(joints[0], chest - [0, 0.1, 0], 0.17, 0.14), (chest, chest, 0.08, 0.08)]
    shapes += [
        (head, offset_point(head, 0, 0.02, 0.02), 0.16, 0.16),
        (offset_point(head, 0, -0.04, 0.14), offset_point(head, 0, -0.04, 0.19), 0.06, 0.04),
    ]
    for side in (-1, 1):
        ear = offset_point(head, side * 0.13, 0.14, 0.0)
        shapes.append((ear, offset_point(ear, side * 0.03, 0.03, 0.0), 0.05, 0.05))
    for first in (Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT):
        shapes += [(joints[first + i], joints[first + i + 1], 0.065, 0.06) for i in range(3)]
    for first in (Joint.HIP_LEFT, Joint.HIP_RIGHT):
        shapes += [(joints[first + i], joints[first + i + 1], 0.085, 0.075) for i in range(3)]
    return KnownBody(extract_surface_of_capsules("teddy", shapes, 0.025, 0.015), joints)


def child() -> KnownBody:
    """Returns a child of four years with a large head, short limbs, and arms away from the body and
    forward.
    """
    scale = {
        model.NECK: 1.25, model.ARM: 0.82, model.FORE: 0.8, model.THIGH: 0.78, model.SHIN: 0.75,
        model.SHOULDER: 0.9,
        model.HAND: 0.85,
    }  # fmt: skip
    joints = posed(scale, arms=((-0.5, 0.0, 0.45),) * 2, elbows=(0.4, 0.4), height=1.15)
    shapes = limb_capsules(joints, 0.72)
    shapes.append((joints[Joint.HEAD], offset_point(joints[Joint.HEAD], 0, 0.04, 0.01), 0.105, 0.105))
    return KnownBody(extract_surface_of_capsules("child", shapes, 0.025, 0.012), joints)


def armour() -> KnownBody:
    """Returns a man in armour: breastplate, shoulder plates, plumed helmet, gauntlets and tassets."""
    joints = posed(arms=((0.0, 0.0, 0.55), (-0.1, 0.0, 0.45)), elbows=(0.35, 0.2), legs=(0.05, 0.14))
    shells = [extract_surface_of_capsules("man", limb_capsules(joints, 0.95))]
    chest, head = joints[Joint.SHOULDER_CENTER], joints[Joint.HEAD]
    shells.append(ball(chest - [0, 0.2, 0], (0.2, 0.26, 0.17)))
    shells.append(ball(offset_point(head, 0, 0.02, 0), (0.14, 0.17, 0.16)))
    shells.append(
        extract_surface_of_capsules(
            "plume",
            [
                (offset_point(head, 0, 0.17, 0.04), offset_point(head, 0, 0.27, -0.04), 0.03, 0.04),
                (offset_point(head, 0, 0.27, -0.04), offset_point(head, 0, 0.12, -0.24), 0.04, 0.03),
            ],
            0.02,
        )
    )
    for side in (-1, 1):
        left = side > 0
        shoulder = joints[Joint.SHOULDER_LEFT if left else Joint.SHOULDER_RIGHT]
        shells.append(ball(offset_point(shoulder, side * 0.05, 0.05, 0), (0.13, 0.1, 0.13)))
        wrist, hand = (joints[j if left else j + 4] for j in (Joint.WRIST_LEFT, Joint.HAND_LEFT))
        shells.append(
            extract_surface_of_capsules(
                "gauntlet", [(wrist - 0.5 * (hand - wrist), hand, 0.075, 0.055)], 0.02
            )
        )
        hip = joints[Joint.HIP_LEFT if left else Joint.HIP_RIGHT]
        shells.append(ball(offset_point(hip, side * 0.06, -0.06, 0.03), (0.1, 0.17, 0.13)))
    return KnownBody(join_shells("armour", shells), joints)


def holed_scan() -> KnownBody:
    """Returns a noisy, rotated scan with holes in its back, its crown and beneath its feet."""
    joints = posed(arms=((0.15, 0.0, 0.5), (-0.2, 0.0, 0.6)), elbows=(0.3, 0.5), legs=(0.0, 0.15), yaw=-0.6)
    mesh = extract_surface_of_capsules("holed-scan", limb_capsules(joints), 0.025)
    noise = np.random.default_rng(5).normal(0.0, 0.003, mesh.vertices.shape)
    back = joints[Joint.SPINE] + rotation(y=-0.6) @ np.array([0.0, 0.1, -0.14])
    crown = np.array([joints[Joint.HEAD][0], mesh.vertices[:, 1].max(), joints[Joint.HEAD][2]])
    gone = (np.linalg.norm(mesh.vertices - back, axis=1) < 0.13) | (
        np.linalg.norm(mesh.vertices - crown, axis=1) < 0.06
    )
    gone |= mesh.vertices[:, 1] < mesh.vertices[:, 1].min() + 0.012
    faces = mesh.faces[~gone[mesh.faces].any(1)]
    used, faces = np.unique(faces, return_inverse=True)
    return KnownBody(
        Mesh((mesh.vertices + noise)[used], faces.reshape(-1, 3).astype(np.int32), mesh.name), joints
    )


BODIES: dict[str, Callable[[], KnownBody]] = {
    made.__name__.replace("_", " "): made
    for made in (a_pose, t_pose, t_woman, sitting, one_arm_up, robot, teddy, child, armour, holed_scan)
}
"""The ten bodies by name."""
CLOSED_BODIES = ("sitting", "teddy", "child", "armour")
"""Held-out set: bodies that were not examined before the mapping was finished."""

NEAR = 0.12
"""Tolerance for a joint to count as found, as a fraction of the mesh's height."""
LIMBS = {
    "left arm": (Joint.ELBOW_LEFT, Joint.HAND_LEFT), "right arm": (Joint.ELBOW_RIGHT, Joint.HAND_RIGHT),
    "left leg": (Joint.KNEE_LEFT, Joint.FOOT_LEFT), "right leg": (Joint.KNEE_RIGHT, Joint.FOOT_RIGHT),
}  # fmt: skip
"""The middle and the end joint of each limb."""


def compare_limbs(joints: Float, known: KnownBody) -> dict[str, bool]:
    """Returns, for each limb, True if both joints are near their known positions."""
    near = NEAR * float(np.ptp(known.mesh.vertices[:, 1]))
    return {
        name: bool((np.linalg.norm(joints[[*limb]] - known.joints[[*limb]], axis=1) < near).all())
        for name, limb in LIMBS.items()
    }
