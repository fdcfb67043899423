"""Contacts: when a foot stands, by its height and speed, and the pins that keep it there.

    Pin(joint, start, settings)              # on a Shape: by the joints' names; nothing is baked
    contacts_of(places (F, 3), step, size, settings) -> Contacts

A foot touches the floor while it is low and slow; it is off again when it is clearly higher or faster
(hysteresis). While it touches, its place is the middle of where it was; it may rise there, as a heel does,
but not sink.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import FEET, ContactSettings
from enliven.kernels import njit

AUTO, ALWAYS, _, GROUND = range(len(FEET))
"""The numbers of the ways to stand."""
_STRAY = 0.25
"""Lengths of its limb over which a foot that is always held may be pulled: a step is a step."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contacts of one joint.

    Attributes:
        starts: (C,) seconds since the first sample, ascending; -inf for one that it begins with.
        ends: (C,) seconds; inf for one that it ends with.
        places: (C, 3) metres where the joint is kept.
    """

    starts: Float
    ends: Float
    places: Float


def contacts_of(
    places: Float, step: float, size: float, how: ContactSettings, modes: Int | None = None
) -> Contacts:
    """When a joint that goes through ``places`` is in contact.

    Args:
        places: (F, 3) metres, +Y up.
        step: seconds between them.
        size: metres, the length of the limb.
        how: what counts as contact.
        modes: (F,) numbers in :data:`enliven.document.FEET` of how it stands then; None: by height and speed.
    """
    if len(places) == 1 and modes is None:
        return Contacts(np.array([-np.inf]), np.array([np.inf]), places.copy())
    height = places[:, 1] - np.percentile(places[:, 1], 5)
    still = np.zeros(len(places))
    speed = np.linalg.norm(np.gradient(places, step, axis=0), axis=1) if len(places) > 1 else still
    down = np.empty(len(places), np.bool_)
    touching(height, speed, how.height * size, how.speed * size, how.release, down)
    spans = runs_of(down)
    if modes is not None:
        low = np.empty_like(down)
        touching(height, still, how.height * size, how.speed * size, how.release, low)
        spans = runs_of(down & (modes == AUTO))
        for a, b in runs_of(low & (modes == ALWAYS)):
            spans += _steps(places, a, b, _STRAY * size)
    spans = sorted((a, b) for a, b in spans if (b - a) * step >= how.shortest)
    starts = np.array([-np.inf if a == 0 else a * step for a, _ in spans])
    ends = np.array([np.inf if b == len(places) - 1 else b * step for _, b in spans])
    middles = np.array([np.median(places[a : b + 1], axis=0) for a, b in spans]).reshape(-1, 3)
    return Contacts(starts, ends, middles)


def _steps(places: Float, first: int, last: int, far: float) -> list[tuple[int, int]]:
    """Parts of a run of frames: a foot that came farther over the ground than ``far`` takes a step."""
    found, begin = list[tuple[int, int]](), first
    for frame in range(first, last + 1):
        way = places[frame, [0, 2]] - places[begin, [0, 2]]
        if way @ way > far * far:
            found.append((begin, frame - 1))
            begin = frame
    return [*found, (begin, last)]


def runs_of(down: Bool) -> list[tuple[int, int]]:
    """The first and the last frame of every run of true in (F,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], down, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


@njit(cache=True, nogil=True)
def touching(height, speed, low, slow, release, down):
    """Kernel: ``down`` (F,) takes whether a foot of ``height`` (F,) and ``speed`` (F,) touches the floor."""
    now = False
    for f in range(len(height)):
        more = release if now else 1.0
        now = height[f] <= low * more and speed[f] <= slow * more
        down[f] = now


@njit(cache=True, nogil=True)
def hold(times, starts, ends, places, blend, weights, goals):
    """Kernel: how much a joint is held, ``weights`` (T,) in [0, 1], and where, ``goals`` (T, 3), at times.

    Within a contact it is held wholly; beside one, as much as smoothstep leaves of ``blend`` seconds. Between
    two, the nearer draws by w / (1 - w): there is no jump, and none of the other where one holds wholly.
    """
    for t in range(len(times)):
        x, y, z, total = 0.0, 0.0, 0.0, 0.0
        weights[t] = 0.0
        for c in range(len(starts)):
            away = max(starts[c] - times[t], times[t] - ends[c], 0.0)
            if away == 0.0:
                x, y, z, total = places[c, 0], places[c, 1], places[c, 2], 1.0
                weights[t] = 1.0
                break
            if away >= blend:
                continue
            u = 1.0 - away / blend
            w = u * u * (3.0 - 2.0 * u)
            draw = w / max(1.0 - w, 1e-12)
            total += draw
            weights[t] = max(weights[t], w)
            x, y, z = x + draw * places[c, 0], y + draw * places[c, 1], z + draw * places[c, 2]
        scale = 1.0 / total if total > 0.0 else 0.0
        goals[t, 0], goals[t, 1], goals[t, 2] = x * scale, y * scale, z * scale
