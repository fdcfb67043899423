"""A small library of motions on chains of a few joints, which scripts/make_samples.py makes by formulas.

Every one but the last begins and ends in the same pose, so that it can be looped. They are takes like any
other: map a chain of one onto a chain of a shape.
"""

from __future__ import annotations

from pathlib import Path

from enliven.document import Clip
from enliven.formats.project import read_project

MOTIONS = Path(__file__).resolve().parent / "motions.enliven"
"""The file of the motions, a project of takes alone."""


def library() -> tuple[Clip, ...]:
    """Returns every motion of the library: wave, curl, reach, walk, sway, and a quarter turn."""
    return tuple(read_project(MOTIONS).takes.values())
