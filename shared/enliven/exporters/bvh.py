"""Writes the motion of a skeleton as a Biovision hierarchy file (.bvh).

The zero pose is the skeleton at rest. A joint of the file turns all that hangs on it, so a joint with bones
that turn differently becomes several joints at one place: the first has its name, the others say where they
lead ("Hips_to_LeftUpLeg"). The last joint of a limb becomes the end site of the one before. The root's place
is in its channels alone; its offset is zero, so that it does not matter whether a reader adds the two. A
joint that takes move on its bone, or which ends a bone that they stretch, has channels for its place too, in
place of its offset, which says where it rests. How wide a bone is the format cannot say.
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
from enliven.exporters.registry import Exporter
from enliven.files import write_file
from enliven.rotation import nearest_rotation

_UNITS = {"m": 1.0, "cm": 100.0}
"""Units of a file in a metre."""
_SAME = 1e-9
"""Largest difference of two bones' rotation matrices that counts as one turn: rounding of the last digits."""
_MOVED = 1e-6
"""Share of all bones' length that a joint moves on its bone by at least to have channels for its place."""
_STILL_STEP = 1.0 / 30.0
"""Seconds that the one frame of a still pose is said to last: the format has no word for a still."""
_CHANNELS = "Zrotation Xrotation Yrotation"
"""Rotations in the order in which they are multiplied, as most recorders write them."""


@dataclass(frozen=True)
class _Joint:
    """A joint of the file.

    Attributes:
        offset: (3,) metres from the joint above it.
        at: the number of its joint in the skeleton.
        moved: whether it changes its place on the joint above.
        bone, above: the bones with the turns of this joint and of the one above it.
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
        name: the title, for which the format has no place.
        unit: of offsets and places, "m" or "cm".

    Raises:
        InputError: for other than one character, one without a skeleton, or an unknown unit.
        ResourceError: where the file cannot be written.
    """
    if len(performances) != 1:
        what = f"a BVH file holds one character, not {len(performances)}"
        raise InputError(what, where=str(path), mend="Choose one: --character NAME.")
    write_file(Path(path), bvh_text(performances[0], unit), "Choose another place.")


def units_in_metre(unit: str = "m") -> float:
    """Returns how many of a unit are a metre.

    Raises:
        InputError: for an unknown unit.
    """
    if unit not in _UNITS:
        raise InputError(f"there is no unit {unit!r}", where="--unit", mend=f"Known: {', '.join(_UNITS)}.")
    return _UNITS[unit]


BVH = Exporter(write_bvh, jointed=True, single=True, check=units_in_metre)


def bvh_text(performance: Performance, unit: str = "m") -> str:
    """Returns the text of the file; see :func:`write_bvh`."""
    skeleton, where = performance.skeleton, f"character {performance.name!r}"
    if skeleton is None:
        mend = "Write a .glb instead: its joints carry any surface."
        raise InputError("it has no skeleton, and a BVH file holds nothing else", where=where, mend=mend)
    scale, times = units_in_metre(unit), performance.times
    turns = nearest_rotation(performance.linear)
    places = _places(skeleton, turns, performance) if performance.stretches else None
    joints = _joints(skeleton, turns, places)
    columns = []
    for joint in joints:
        if joint.above < 0:
            columns.append(performance.positions[:, 0] * scale)
        elif joint.moved and places is not None:
            columns.append(places[:, joint.at] * scale)
        columns.append(_angles(_local(turns, joint.above, joint.bone)))
    rows = io.StringIO()
    np.savetxt(rows, np.concatenate(columns, 1), "%.6f")
    step = (times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else _STILL_STEP
    head = f"MOTION\nFrames: {len(times)}\nFrame Time: {step:.9g}\n"
    return "HIERARCHY\n" + "".join(_lines(joints, scale)) + head + rows.getvalue()


def _places(skeleton: Skeleton, turns: Float, performance: Performance) -> Float:
    """(T, N, 3) metres, where each joint is in the turned frame of its bone, from where that begins."""
    assert performance.joints is not None
    ways = performance.joints - performance.positions
    return np.asarray(np.einsum("tnba,tnb->tna", turns, ways))


def _joints(skeleton: Skeleton, linear: Float, places: Float | None) -> list[_Joint]:
    """Returns the joints of the file, parents before children, from the bones' turns (T, N, 3, 3).

    ``places`` is what :func:`_places` gives, or None where bones are stiff.
    """
    made: list[_Joint] = []
    moves = np.zeros(len(skeleton), bool)
    if places is not None:
        moves = np.abs(places - skeleton.vectors).max((0, 2)) > _MOVED * skeleton.lengths.sum()
    taken: set[str] = set()

    def add(name: str, at: int, bone: int, above: int, depth: int, ends: list[int], more: bool) -> None:
        """Adds joint ``at`` that turns as ``bone``, with all bones that end at ``ends`` and what hangs there.

        ``at`` is -1 for one at the place of the root; ``more`` says that other joints are to be hung on it.
        """
        alone = len(ends) == 1 and not skeleton.children[ends[0]] and not more and not moves[ends[0]]
        end = skeleton.vectors[ends[0]] if alone else None if ends or more else np.zeros(3)
        # Many readers end a name at a blank.
        own = unused("_".join(name.split()) or "joint", taken, "_")
        taken.add(own)
        offset = np.zeros(3) if at < 0 else skeleton.vectors[at]
        made.append(_Joint(own, offset, at, at >= 0 and bool(moves[at]), bone, above, depth, end))
        for joint in [] if alone else ends:
            called = skeleton.names[joint]
            groups = _groups(linear, skeleton.children[joint])
            if not groups:
                add(called, joint, bone, bone, depth + 1, [], False)
            for number, group in enumerate(groups):
                leads = called if number == 0 else f"{called} to {skeleton.names[group[0]]}"
                add(leads, joint, group[0], bone, depth + 1, group, False)

    with_root, *others = _groups(linear, (0, *skeleton.children[0]))
    add(skeleton.names[0], -1, 0, -1, 0, with_root[1:], bool(others))
    for group in others:
        add(f"{skeleton.names[0]} to {skeleton.names[group[0]]}", -1, group[0], 0, 1, group, False)
    return made


def _groups(linear: Float, bones: Sequence[int]) -> list[list[int]]:
    """Returns the bones in groups of those that turn alike in all frames, in their order."""
    groups: list[list[int]] = []
    for bone in bones:
        for group in groups:
            if np.abs(linear[:, bone] - linear[:, group[0]]).max() <= _SAME:
                group.append(bone)
                break
        else:
            groups.append([bone])
    return groups


def _lines(joints: Sequence[_Joint], scale: float) -> list[str]:
    """Returns the lines from ROOT to the last brace."""
    lines = []
    for joint, after in zip(joints, [*joints[1:], None], strict=True):
        tabs = "\t" * joint.depth
        kind = "JOINT" if joint.depth else "ROOT"
        places = "Xposition Yposition Zposition " if joint.moved or not joint.depth else ""
        lines.append(f"{tabs}{kind} {joint.name}\n{tabs}{{\n{tabs}\tOFFSET {_three(joint.offset, scale)}\n")
        lines.append(f"{tabs}\tCHANNELS {6 if places else 3} {places}{_CHANNELS}\n")
        if joint.end is not None:
            inner = f"{tabs}\t\tOFFSET {_three(joint.end, scale)}\n"
            lines.append(f"{tabs}\tEnd Site\n{tabs}\t{{\n{inner}{tabs}\t}}\n")
        left = 0 if after is None else after.depth
        lines += ["\t" * depth + "}\n" for depth in range(joint.depth, left - 1, -1)]
    return lines


def _three(vector: Float, scale: float) -> str:
    return " ".join(f"{value * scale:.6f}" for value in vector)


def _local(linear: Float, above: int, bone: int) -> Float:
    """(T, 3, 3) the turn of a bone in that of another; in the world where the other is -1."""
    if above < 0:
        return linear[:, bone]
    return np.asarray(linear[:, above].transpose(0, 2, 1) @ linear[:, bone])


def _angles(turns: Float) -> Float:
    """(T, 3) degrees about Z, X and Y with turn = Z X Y, without jumps of a whole turn in time."""
    away = np.hypot(turns[:, 2, 0], turns[:, 2, 2])
    level = away > 1e-9
    z = np.where(
        level, np.arctan2(-turns[:, 0, 1], turns[:, 1, 1]), np.arctan2(turns[:, 1, 0], turns[:, 0, 0])
    )
    y = np.where(level, np.arctan2(-turns[:, 2, 0], turns[:, 2, 2]), 0.0)
    x = np.arctan2(turns[:, 2, 1], away)
    return np.degrees(np.unwrap(np.stack([z, x, y], 1), axis=0))
