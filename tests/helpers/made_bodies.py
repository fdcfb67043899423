"""Generates bodies for tests (a man, a horse, a spider, a snake), with and without descriptive joint names,
and motions.
"""

from __future__ import annotations

import numpy as np

from enliven.document.character import SkinWeights
from enliven.document.clip import Clip
from enliven.document.rigged import still_shape
from enliven.document.skeleton import Skeleton
from enliven.meshes.mesh import Mesh
from enliven.rotation import from_rotation_vector, multiply


def build_skeleton(*joints, named=True) -> Skeleton:
    """Returns joints as (name, parent's name or None, position). Each joint named L... is mirrored to R..."""
    names, parents, at = [], [], []
    for name, parent, place in joints:
        sides = [("L", 1), ("R", -1)] if "L" in name else [("", 1)]
        for side, sign in sides:
            names.append(name.replace("L", "Left " if side == "L" else "Right ") if side else name)
            above = parent
            if parent and "L" in parent:
                above = parent.replace("L", "Left " if side == "L" else "Right ")
            parents.append(-1 if parent is None else names.index(above))
            at.append([place[0] * sign, place[1], place[2]])
    if not named:
        names = [f"joint {j}" for j in range(len(names))]
    return Skeleton(tuple(names), np.array(parents), np.array(at, float))


def man(named=True) -> Skeleton:
    return build_skeleton(
        ("hips", None, (0, 0.95, 0)),
        ("spine", "hips", (0, 1.1, -0.01)),
        ("chest", "spine", (0, 1.35, -0.02)),
        ("neck", "chest", (0, 1.5, 0)),
        ("head", "neck", (0, 1.6, 0.02)),
        ("top", "head", (0, 1.78, 0.02)),
        ("Lcollar", "chest", (0.02, 1.42, 0)),
        ("Lshoulder", "Lcollar", (0.18, 1.44, 0)),
        ("Lelbow", "Lshoulder", (0.46, 1.44, -0.01)),
        ("Lwrist", "Lelbow", (0.71, 1.44, 0)),
        ("Lfinger", "Lwrist", (0.88, 1.44, 0)),
        ("Lthumb", "Lwrist", (0.76, 1.43, 0.05)),
        ("Lhip", "hips", (0.09, 0.9, 0)),
        ("Lknee", "Lhip", (0.1, 0.5, 0.01)),
        ("Lankle", "Lknee", (0.1, 0.09, -0.01)),
        ("Ltoe", "Lankle", (0.1, 0.02, 0.16)),
        named=named,
    )


def horse(named=True) -> Skeleton:
    return build_skeleton(
        ("croup", None, (0, 1.5, -0.8)),
        ("loin", "croup", (0, 1.52, -0.2)),
        ("withers", "loin", (0, 1.6, 0.5)),
        ("neck", "withers", (0, 1.9, 0.9)),
        ("poll", "neck", (0, 2.3, 1.2)),
        ("nose", "poll", (0, 2.0, 1.6)),
        ("Lear", "poll", (0.08, 2.45, 1.2)),
        ("Lshoulder", "withers", (0.18, 1.2, 0.6)),
        ("Lelbow", "Lshoulder", (0.18, 0.9, 0.45)),
        ("Lfore knee", "Lelbow", (0.18, 0.5, 0.5)),
        ("Lfore hoof", "Lfore knee", (0.18, 0.02, 0.5)),
        ("Lhip", "croup", (0.18, 1.3, -0.9)),
        ("Lstifle", "Lhip", (0.18, 0.95, -0.7)),
        ("Lhock", "Lstifle", (0.18, 0.55, -1.0)),
        ("Lhind hoof", "Lhock", (0.18, 0.02, -0.9)),
        ("dock", "croup", (0, 1.5, -1.1)),
        ("tail", "dock", (0, 1.1, -1.3)),
        ("tail end", "tail", (0, 0.6, -1.35)),
        named=named,
    )


def spider() -> Skeleton:
    joints = [("body", None, (0, 0.6, 0)), ("abdomen", "body", (0, 0.7, -1.2))]
    for k in range(4):
        z = 0.6 - 0.4 * k
        joints += [
            (f"Lcoxa {k}", "body", (0.2, 0.6, z / 3)),
            (f"Lknee {k}", f"Lcoxa {k}", (0.8, 1.1, z)),
            (f"Lfoot {k}", f"Lknee {k}", (1.6, 0.0, 1.6 * z)),
        ]
    return build_skeleton(*joints)


def crawler(random) -> Skeleton:
    """Returns a body with two to five pairs of legs.

    Each leg has three or four joints. The legs are high or wide, with knees above or below the body.
    """
    pairs, tall, wide = int(random.integers(2, 6)), random.uniform(0.25, 1.2), random.uniform(0.5, 1.8)
    tail = (0, tall * random.uniform(0.9, 1.2), -random.uniform(0.5, 1.3))
    joints = [("body", None, (0, tall, 0)), ("abdomen", "body", tail)]
    for k in range(pairs):
        z = 0.25 * (pairs - 1) - 0.5 * k
        knee, far = tall * random.uniform(0.5, 1.9), z * random.uniform(0.8, 1.7)
        joints.append((f"Lcoxa {k}", "body", (0.2, tall, z / 3)))
        joints.append((f"Lknee {k}", f"Lcoxa {k}", (0.2 + 0.4 * wide, knee, 0.6 * far)))
        above = f"Lknee {k}"
        if random.random() < 0.4:
            joints.append((f"Lshank {k}", above, (0.2 + 0.75 * wide, 0.45 * knee, 0.8 * far)))
            above = f"Lshank {k}"
        joints.append((f"Lfoot {k}", above, (0.2 + wide, 0.0, far)))
    return build_skeleton(*joints, named=bool(random.random() < 0.5))


def snake() -> Skeleton:
    joints = [("middle", None, (0, 0.1, 0))]
    joints += [(f"fore {k}", "middle" if k == 1 else f"fore {k - 1}", (0, 0.1, 0.3 * k)) for k in (1, 2, 3)]
    joints += [(f"hind {k}", "middle" if k == 1 else f"hind {k - 1}", (0, 0.1, -0.3 * k)) for k in (1, 2, 3)]
    return build_skeleton(*joints)


def rotate_skeleton(skeleton: Skeleton, angle: float) -> Skeleton:
    """Returns the skeleton rotated by ``angle`` radians about +Y."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return Skeleton(skeleton.names, skeleton.parents, skeleton.positions @ matrix.T)


def random_motion(random, skeleton: Skeleton, frames=8, size=0.25, name="take") -> Clip:
    """Returns a random motion. Every bone rotates slightly about random axes relative to its parent, and the
    root travels.
    """
    count = len(skeleton)
    turns = np.empty((frames, count, 4))
    ends = random.normal(size=(2, count, 3)) * size
    for f in range(frames):
        local = from_rotation_vector(ends[0] + (ends[1] - ends[0]) * f / max(frames - 1, 1))
        for j in range(count):
            above = skeleton.parents[j]
            turns[f, j] = local[j] if above < 0 else multiply(turns[f, above], local[j])
    root = skeleton.positions[0] + np.linspace(0, 1, frames)[:, None] * random.normal(size=3)
    return Clip(name, skeleton, turns, root, 0.1)


def rotate_clip(clip: Clip, angle: float) -> Clip:
    """Returns the same performance by a person that is rotated by ``angle`` radians about +Y."""
    q = from_rotation_vector(np.array([0.0, angle, 0.0]))
    back = q * [1, -1, -1, -1]
    skeleton = rotate_skeleton(clip.skeleton, angle)
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return Clip(clip.id, skeleton, multiply(multiply(q, clip.turns), back), clip.root @ matrix.T, clip.step)


def walk(stride=0.5, heading=0.0, raised=0.0) -> Clip:
    """Returns a walking man.

    One foot stands exactly still while the other moves two strides ahead. His arms hang, or are ``raised``
    from hanging by this angle in radians.
    """
    skeleton = man()
    phase = np.arange(61) / 15.0
    root = np.tile(skeleton.positions[0] - [0, 0.06, 0], (61, 1))
    root[:, 2] += stride * phase
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (61, len(skeleton), 1))
    for side, begin, sign in (("Left", 0.0, 1.0), ("Right", 1.0, -1.0)):
        for name in ("elbow", "wrist", "finger", "thumb"):
            about = np.array([0.0, 0.0, sign * (raised - np.pi / 2)])
            turns[:, skeleton.index(f"{side} {name}")] = from_rotation_vector(about)
        hip, knee, ankle = (skeleton.index(f"{side} {name}") for name in ("hip", "knee", "ankle"))
        gone, part = np.divmod(phase + begin, 2.0)
        ahead = 2.0 * stride * (gone + np.clip(part - 1.0, 0.0, 1.0)) - stride * begin + stride / 2.0
        high = 0.1 * np.sin(np.pi * np.clip(part - 1.0, 0.0, 1.0))
        start = root + skeleton.positions[hip] - skeleton.positions[0]
        goal = np.stack([start[:, 0] + 0.01, 0.09 + high, ahead], 1)
        upper, lower = skeleton.lengths[knee], skeleton.lengths[ankle]
        way = goal - start
        far = np.minimum(np.linalg.norm(way, axis=1), 0.999 * (upper + lower))
        bend = np.arccos((upper**2 + far**2 - lower**2) / (2 * upper * far))
        slope = np.arctan2(way[:, 2], -way[:, 1])
        beyond = np.arccos((upper**2 + lower**2 - far**2) / (2 * upper * lower)) - np.pi
        turns[:, knee] = _rotate_about_x(-(slope + bend))
        turns[:, ankle] = _rotate_about_x(-(slope + bend + beyond))
    return rotate_clip(Clip("walk", skeleton, turns, root, 1 / 30), heading)


def _rotate_about_x(angles):
    return from_rotation_vector(np.stack([angles, 0 * angles, 0 * angles], 1))


def shape_with_markers(name: str, skeleton: Skeleton):
    """Returns a mesh in the rest pose with a small triangle at the end of every bone."""
    count = len(skeleton)
    corners = np.array([[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0.02]])
    vertices = (skeleton.positions[:, None] + corners).reshape(-1, 3)
    mesh = Mesh(vertices, np.arange(3 * count, dtype=np.int32).reshape(-1, 3), name)
    indices = np.zeros((3 * count, 4), np.uint16)
    indices[:, 0] = np.repeat(np.arange(count), 3)
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (3 * count, 1))
    return still_shape(name, skeleton, mesh, SkinWeights(indices, weights))


def bvh_text(skeleton: Skeleton, frames: np.ndarray, seconds=0.05) -> str:
    """Returns the text of a BVH file. ``frames`` (F, N, 3) are rotations in degrees about Z, X, Y of the
    joints with children.
    """
    lines: list[str] = ["HIERARCHY"]
    order: list[int] = []

    def write(j: int, pad: str) -> None:
        offset = skeleton.vectors[j] if j else skeleton.positions[0]
        offset_text = " ".join(f"{x:.6f}" for x in offset)
        if j and not skeleton.children[j]:
            lines.extend([f"{pad}End Site", pad + "{", f"{pad}  OFFSET {offset_text}", pad + "}"])
            return
        order.append(j)
        lines.extend([f"{pad}{'JOINT' if j else 'ROOT'} {skeleton.names[j]}", pad + "{"])
        lines.append(f"{pad}  OFFSET {offset_text}")
        places = "6 Xposition Yposition Zposition" if j == 0 else "3"
        lines.append(f"{pad}  CHANNELS {places} Zrotation Xrotation Yrotation")
        for child in skeleton.children[j]:
            write(child, pad + "  ")
        lines.append(pad + "}")

    write(0, "")
    lines += ["MOTION", f"Frames: {len(frames)}", f"Frame Time: {seconds}"]
    for f, frame in enumerate(frames):
        row = [*(skeleton.positions[0] + [0, 0, 0.1 * f])]
        for j in order:
            row += list(frame[j])
        lines.append(" ".join(f"{x:.6f}" for x in row))
    return "\n".join(lines) + "\n"


def shape_with_joint_bands(name: str, skeleton: Skeleton):
    """Returns a mesh in the rest pose with a band across every joint, from its parent bone to its child
    bone.
    """
    vertices, faces, indices = [], [], []
    wide = np.array([0.1, 0.0, 0.1])
    for j in range(1, len(skeleton)):
        above, first = int(skeleton.parents[j]), len(vertices)
        start = skeleton.positions[above]
        after = start + 0.2 * skeleton.vectors[j]
        vertices += [start - wide, start + wide, after - wide, after + wide]
        faces += [[first, first + 1, first + 3], [first, first + 3, first + 2]]
        indices += [above, above, j, j]
    mesh = Mesh(np.array(vertices), np.array(faces, np.int32), name)
    bones = np.zeros((len(vertices), 4), np.uint16)
    bones[:, 0] = indices
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(vertices), 1))
    return still_shape(name, skeleton, mesh, SkinWeights(bones, weights))
