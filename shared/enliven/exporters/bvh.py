"""Writes the motion of a skeleton as a Biovision hierarchy file (.bvh).

The zero pose is the skeleton at rest. A joint of the file rotates its whole subtree. So a joint with bones
that rotate differently becomes several joints at the same position. The first of them keeps the joint's name,
and the names of the others contain their target ("Hips_to_LeftUpLeg"). The last joint of a limb becomes the
end site of the previous one. The root's offset is zero and its position is only in its channels, since some
readers add offset and position. Joints that move along their bone, and joints at the end of a stretched bone,
also have position channels. These channels replace the joint's offset, which contains its rest position. The
format cannot store the width of a bone.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton, unused
from enliven.errors import InputError
from enliven.exporters.performance import Performance
from enliven.exporters.placement import PLACEMENTS, units_per_metre
from enliven.exporters.registry import Exporter
from enliven.files import write_file
from enliven.rotation import nearest_rotation

_SAME_ROTATION_DIFFERENCE = 1e-9
"""Maximum difference between the entries of two equal rotation matrices. It allows for rounding."""
_MIN_BONE_MOTION_FRACTION = 1e-6
"""Minimum motion of a joint along its bone, as a fraction of the length of all bones. With less motion, a
joint has no position channels."""
_STILL_STEP = 1.0 / 30.0
"""Frame time of a still pose, in seconds. The format requires a frame time even for one frame."""
_ROTATION_CHANNELS = "Zrotation Xrotation Yrotation"
"""Rotation channels in the order of multiplication. Most motion capture programs use this order."""


@dataclass(frozen=True)
class _Joint:
    """A joint of the file.

    Attributes:
        offset: (3,) metres from the parent joint.
        at: number of the corresponding joint in the skeleton.
        moved: True if its position relative to the parent joint changes.
        bone, above: the bones that define the rotations of this joint and of its parent joint.
        end: (3,) metres, the offset of its end site, or None.
    """

    name: str
    offset: Float
    at: int
    moved: bool
    bone: int
    above: int
    depth: int
    end: Float | None


def write_bvh(
    path: Path | str,
    performances: Sequence[Performance],
    name: str = "enliven",
    unit: str = "m",
) -> None:
    """Writes the skeleton of one character and its motion.

    Args:
        name: the title. It is ignored, because the format cannot store it.
        unit: unit of offsets and positions, "m" or "cm".

    Raises:
        InputError: if there is not exactly one character, if it has no skeleton, or if the unit is unknown.
        ResourceError: if the file cannot be written.
    """
    if len(performances) != 1:
        problem = f"a BVH file can contain only one character, but {len(performances)} are selected"
        raise InputError(problem, where=str(path), remedy="Choose one with --character NAME.")
    write_file(Path(path), bvh_text(performances[0], unit), "Choose another output file.")


BVH = Exporter(
    write_bvh, jointed=True, solid=False, single=True, placements=PLACEMENTS, check=units_per_metre
)


def bvh_text(performance: Performance, unit: str = "m") -> str:
    """Returns the text of the file. See :func:`write_bvh`."""
    skeleton, location = performance.skeleton, f"character {performance.name!r}"
    if skeleton is None:
        remedy = "Export a .glb file instead. It can contain a surface without a skeleton."
        raise InputError(
            "the character has no skeleton, and a BVH file can contain only skeletons",
            where=location,
            remedy=remedy,
        )
    scale, times = units_per_metre(unit), performance.times
    turns = nearest_rotation(performance.linear)
    places = _joint_places(skeleton, turns, performance) if performance.stretches else None
    joints = _file_joints(skeleton, turns, places)
    columns = []
    for joint in joints:
        if joint.above < 0:
            columns.append(performance.positions[:, 0] * scale)
        elif joint.moved and places is not None:
            columns.append(places[:, joint.at] * scale)
        columns.append(_euler_angles(_local_rotations(turns, joint.above, joint.bone)))
    rows = io.StringIO()
    np.savetxt(rows, np.concatenate(columns, 1), "%.6f")
    step = (times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else _STILL_STEP
    head = f"MOTION\nFrames: {len(times)}\nFrame Time: {step:.9g}\n"
    return "HIERARCHY\n" + "".join(_hierarchy_lines(joints, scale)) + head + rows.getvalue()


def _joint_places(skeleton: Skeleton, turns: Float, performance: Performance) -> Float:
    """Returns the position (T, N, 3) of each joint relative to its parent joint, in metres, in the rotated
    frame of its bone."""
    assert performance.joints is not None
    offsets = performance.joints - performance.positions
    return np.asarray(np.einsum("tnba,tnb->tna", turns, offsets))


def _file_joints(skeleton: Skeleton, linear: Float, places: Float | None) -> list[_Joint]:
    """Returns the joints of the file, parents before children.

    ``linear`` contains the bones' rotations (T, N, 3, 3). ``places`` is the result of :func:`_joint_places`,
    or None if the bones are rigid.
    """
    joints: list[_Joint] = []
    is_moving = np.zeros(len(skeleton), bool)
    if places is not None:
        is_moving = (
            np.abs(places - skeleton.vectors).max((0, 2)) > _MIN_BONE_MOTION_FRACTION * skeleton.lengths.sum()
        )
    used_names: set[str] = set()

    def add(name: str, at: int, bone: int, above: int, depth: int, ends: list[int], more: bool) -> None:
        """Adds joint ``at`` with the rotation of ``bone``, and the subtrees of the bones that end at the
        joints ``ends``.

        ``at`` is -1 for a joint at the position of the root. ``more`` is True if other joints will be
        attached to the new joint.
        """
        is_end = len(ends) == 1 and not skeleton.children[ends[0]] and not more and not is_moving[ends[0]]
        end = skeleton.vectors[ends[0]] if is_end else None if ends or more else np.zeros(3)
        # Many readers use only the part of a name before the first space.
        joint_name = unused("_".join(name.split()) or "joint", used_names, "_")
        used_names.add(joint_name)
        offset = np.zeros(3) if at < 0 else skeleton.vectors[at]
        joints.append(
            _Joint(joint_name, offset, at, at >= 0 and bool(is_moving[at]), bone, above, depth, end)
        )
        for joint in [] if is_end else ends:
            joint_name_text = skeleton.names[joint]
            groups = _find_equal_rotation_groups(linear, skeleton.children[joint])
            if not groups:
                add(joint_name_text, joint, bone, bone, depth + 1, [], False)
            for number, group in enumerate(groups):
                first_name = (
                    joint_name_text if number == 0 else f"{joint_name_text} to {skeleton.names[group[0]]}"
                )
                add(first_name, joint, group[0], bone, depth + 1, group, False)

    with_root, *others = _find_equal_rotation_groups(linear, (0, *skeleton.children[0]))
    add(skeleton.names[0], -1, 0, -1, 0, with_root[1:], bool(others))
    for group in others:
        add(f"{skeleton.names[0]} to {skeleton.names[group[0]]}", -1, group[0], 0, 1, group, False)
    return joints


def _find_equal_rotation_groups(linear: Float, bones: Sequence[int]) -> list[list[int]]:
    """Groups the bones that rotate equally in all frames. The order of the bones is kept."""
    groups: list[list[int]] = []
    for bone in bones:
        for group in groups:
            if np.abs(linear[:, bone] - linear[:, group[0]]).max() <= _SAME_ROTATION_DIFFERENCE:
                group.append(bone)
                break
        else:
            groups.append([bone])
    return groups


def _hierarchy_lines(joints: Sequence[_Joint], scale: float) -> list[str]:
    """Returns the lines of the hierarchy section, from ROOT to the last brace."""
    lines = []
    for joint, after in zip(joints, [*joints[1:], None], strict=True):
        tabs = "\t" * joint.depth
        kind = "JOINT" if joint.depth else "ROOT"
        places = "Xposition Yposition Zposition " if joint.moved or not joint.depth else ""
        lines.append(
            f"{tabs}{kind} {joint.name}\n{tabs}{{\n{tabs}\tOFFSET {_vector_text(joint.offset, scale)}\n"
        )
        lines.append(f"{tabs}\tCHANNELS {6 if places else 3} {places}{_ROTATION_CHANNELS}\n")
        if joint.end is not None:
            inner = f"{tabs}\t\tOFFSET {_vector_text(joint.end, scale)}\n"
            lines.append(f"{tabs}\tEnd Site\n{tabs}\t{{\n{inner}{tabs}\t}}\n")
        left = 0 if after is None else after.depth
        lines += ["\t" * depth + "}\n" for depth in range(joint.depth, left - 1, -1)]
    return lines


def _vector_text(vector: Float, scale: float) -> str:
    return " ".join(f"{value * scale:.6f}" for value in vector)


def _local_rotations(linear: Float, above: int, bone: int) -> Float:
    """Returns the rotation (T, 3, 3) of a bone relative to another. If ``above`` is -1, the rotation is
    relative to the world.
    """
    if above < 0:
        return linear[:, bone]
    return np.asarray(linear[:, above].transpose(0, 2, 1) @ linear[:, bone])


def _euler_angles(turns: Float) -> Float:
    """Returns Euler angles (T, 3) in degrees about Z, X and Y, with rotation = Z X Y. The angles do not jump
    by a full turn.
    """
    cos_x = np.hypot(turns[:, 2, 0], turns[:, 2, 2])
    level = cos_x > 1e-9
    z = np.where(
        level, np.arctan2(-turns[:, 0, 1], turns[:, 1, 1]), np.arctan2(turns[:, 1, 0], turns[:, 0, 0])
    )
    y = np.where(level, np.arctan2(-turns[:, 2, 0], turns[:, 2, 2]), 0.0)
    x = np.arctan2(turns[:, 2, 1], cos_x)
    return np.degrees(np.unwrap(np.stack([z, x, y], 1), axis=0))
