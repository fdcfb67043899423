"""A small library of motions on chains of a few joints, generated from formulas by scripts/make_samples.py.

All but the last begin and end in the same pose, so that they can loop. They are ordinary takes. To use one,
map its chain to a chain of a shape.
"""

from __future__ import annotations

from pathlib import Path

from enliven.document import Clip
from enliven.formats.project.file import read_project

MOTIONS_FILE = Path(__file__).resolve().parent / "motions.enliven"
"""The file of the motions: a project that contains only takes."""


def read_library() -> tuple[Clip, ...]:
    """Returns every motion of the library: wave, curl, reach, walk, sway, and a quarter turn."""
    return tuple(read_project(MOTIONS_FILE).takes.values())
