"""Helpers of all copies and moves: the takes that come along, and checks of offsets, turns and delays."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Project, same, unused
from enliven.errors import InputError


def with_takes_of(project: Project, source: Project, names: Iterable[str]) -> tuple[Project, dict[str, str]]:
    """The project with takes of another, and the id of each here; those it has, bit for bit, are used."""
    ids: dict[str, str] = {}
    for name in dict.fromkeys(names):
        take = source.takes[name]
        here = project.takes.get(take.id)
        if here is None or not same(here, take):
            take = replace(take, id=unused(take.id, project.takes))
            project = project.with_takes(take)
        ids[name] = take.id
    return project, ids


def checked_shift(offset: AnyArray, delay: float, where: str) -> Float:
    """(3,) metres from something to its copy, which moves ``delay`` seconds later.

    Raises:
        InputError: where one of them is no number.
    """
    shift = np.asarray(offset, np.float64)
    if shift.shape != (3,) or not np.isfinite(shift).all() or not np.isfinite(delay):
        what = f"a copy cannot be {offset} m away and {delay} s late"
        raise InputError(what, where=where, mend="Give three metres and seconds.")
    return shift


def checked_motion(
    offset: AnyArray, turn: AnyArray, about: AnyArray | None, where: str
) -> tuple[Float, Float, Float]:
    """(3,) offset, (4,) turn and (3,) centre, else the origin, of x -> turn (x - centre) + centre + offset.

    Raises:
        InputError: where a number is not finite, or the turn is no unit quaternion.
    """
    centre = np.zeros(3) if about is None else np.asarray(about, np.float64)
    offset, turn = np.asarray(offset, np.float64), np.asarray(turn, np.float64)
    if not (np.isfinite(offset).all() and np.isfinite(centre).all() and abs(np.linalg.norm(turn) - 1) < 1e-6):
        raise InputError(f"it cannot be moved by {offset}, {turn}", where=where, mend="Give numbers.")
    return offset, turn, centre
