"""Walks seen by a Kinect v1, as the KinectGait data set has them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.person import Body, Joint
from enliven_edge.importing.base import DEFAULT_OPTIONS, ImportOptions, Reader, head_of, only_one
from enliven_edge.importing.skeletons import (
    TRACKED,
    WORLD_FROM_KINECT_SPACE,
    SkeletonMoment,
    frames_in_world,
    observed,
)
from enliven_edge.importing.tables import first_lines, numbers_of, rows_of

NAMES = {joint.name.replace("_", "-").title(): joint for joint in Joint} | {
    "Hip-Centro": Joint.HIP_CENTER,
    "Shoulder-Centro": Joint.SHOULDER_CENTER,
}
"""The joint of each name; the files mix languages (``Hip-centro``)."""
_FIRST = "Head"


class GaitReader(Reader):
    """``Joint-Name;x;y;z`` lines in metres; a frame starts at ``Head`` and has 20 lines."""

    name = "kinect-gait"
    description = "KinectGait text (Joint-Name;x;y;z lines, 20 a frame)"
    note = "no times in the files: 30 frames a second; no tracking states: every joint counts as tracked"

    def can_read(self, paths: Sequence[Path]) -> bool:
        return any(_matches(path) for path in paths)

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[BodyFrame]:
        path = only_one([path for path in paths if _matches(path)] or paths)
        rows = rows_of(path, ";")
        joints = [_joint(row[0], path, line) for line, row in enumerate(rows, 1)]
        values = numbers_of([row[1:] for row in rows], path, 3)
        starts = [line for line, joint in enumerate(joints) if joint == Joint.HEAD] + [len(values)]
        moments = []
        for start, end, time_ns in zip(starts, starts[1:], options.times_ns(30.0), strict=False):
            xyz = np.full((len(Joint), 3), np.nan)
            xyz[joints[start:end]] = values[start:end]
            if np.isfinite(xyz[:, 0]).any():
                moments.append(
                    SkeletonMoment(time_ns, [Body(0, *observed(xyz, np.full(len(Joint), TRACKED)))])
                )
        return frames_in_world(moments, options.device or "kinect1", WORLD_FROM_KINECT_SPACE, str(path))


def _joint(name: str, path: Path, line: int) -> Joint:
    joint = NAMES.get(name.strip().title())
    if joint is None:
        raise InputError(
            f"line {line} names the joint {name!r}", where=str(path), mend=f"Known: {', '.join(NAMES)}."
        )
    return joint


def _matches(path: Path) -> bool:
    rows = [line.split(";") for line in first_lines(head_of(path), 20)]
    return bool(rows) and all(len(row) == 4 and row[0].strip().title() in NAMES for row in rows)
