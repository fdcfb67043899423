"""Writes motion as a table (.csv): one row for each frame and joint or part, for spreadsheets and scripts.

The columns are:

- ``character``, ``frame`` (from 0), ``time_s`` (seconds from the first frame)
- ``part``: the joint's name, or ``part 0``, ``part 1``, ... for a surface without a skeleton. ``parent``: the
  name of the parent joint, or empty
- ``x_m``, ``y_m``, ``z_m``: position in the world in metres (with the unit cm: ``x_cm``, ...)
- ``qw``, ``qx``, ``qy``, ``qz``: rotation in the world since the rest pose, as a unit quaternion without sign
  jumps. A joint has the rotation of the bone that ends at the joint, and the root has the rotation of the
  whole skeleton
- ``stretch_x``, ``stretch_y``, ``stretch_z``: stretch factors along the axes of the rest pose
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.exporters.performance import Performance
from enliven.exporters.placement import PLACEMENTS, units_per_metre
from enliven.exporters.registry import Exporter
from enliven.files import explain_write_errors, replace_file
from enliven.rotation import from_matrix, nearest_rotation, remove_sign_jumps

_REMEDY = "Choose another output file."
_ROTATION_COLUMNS = ("qw", "qx", "qy", "qz", "stretch_x", "stretch_y", "stretch_z")


def write_csv(
    path: Path | str,
    performances: Sequence[Performance],
    name: str = "enliven",
    unit: str = "m",
    progress: Callable[[float], object] | None = None,
) -> None:
    """Writes the positions and rotations of all joints or parts.

    Args:
        name: the title, which the format cannot store.
        unit: unit of positions, "m" or "cm".
        progress: called with the finished fraction. An exception that it raises ends the export.

    Raises:
        InputError: if the unit is unknown.
        ResourceError: if the file cannot be written.
    """
    scale = units_per_metre(unit)
    frames = max(sum(len(performance.times) for performance in performances), 1)
    positions = tuple(f"{axis}_{unit}" for axis in "xyz")
    path = Path(path)
    with (
        replace_file(path, _REMEDY) as part,
        explain_write_errors(path, _REMEDY),
        part.open("w", encoding="utf-8", newline="") as file,
    ):
        table = csv.writer(file)
        table.writerow(("character", "frame", "time_s", "part", "parent", *positions, *_ROTATION_COLUMNS))
        finished = 0
        for performance in performances:
            for rows in _frame_rows(performance, scale):
                table.writerows(rows)
                finished += 1
                if progress is not None:
                    progress(finished / frames)


CSV = Exporter(
    write_csv, solid=False, placements=PLACEMENTS, check=lambda unit="m", **_: units_per_metre(unit)
)


def _frame_rows(performance: Performance, scale: float) -> Iterator[list[list[str]]]:
    """Yields the rows of each frame."""
    names, parents = _part_names(performance)
    poses = list(performance.poses())
    linear = np.array([pose.linear for pose in poses], np.float64)
    places: Float = np.array([pose.positions for pose in poses], np.float64)
    if performance.joints is not None:
        places = performance.joints
    rotations = remove_sign_jumps(from_matrix(nearest_rotation(linear)))
    values = np.concatenate([places * scale, rotations, np.linalg.norm(linear, axis=2)], 2)
    # Adding zero converts -0.0 to 0.0.
    rounded_values = np.round(values, 6) + 0.0
    for number, (time, frame) in enumerate(zip(performance.times, rounded_values.tolist(), strict=True)):
        head = [performance.name, str(number), f"{time:.6f}"]
        yield [
            [*head, part, parent, *(f"{value:.6f}" for value in row)]
            for part, parent, row in zip(names, parents, frame, strict=True)
        ]


def _part_names(performance: Performance) -> tuple[list[str], list[str]]:
    """Returns the names of all parts, and the names of their parents."""
    skeleton = performance.skeleton
    if skeleton is None:
        count = len(performance.pivots)
        return [f"part {number}" for number in range(count)], [""] * count
    names = list(skeleton.names)
    return names, ["" if parent < 0 else names[parent] for parent in skeleton.parents]
