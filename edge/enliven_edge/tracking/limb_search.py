"""Looking for a limb everywhere it can be, with the rest of the body as it is.

A limb that was caught by something else (a forearm by the thigh beside it) is explained well enough where it
is, so that no fit that starts there leaves. But it has few angles: a bank of all its postures is judged by
some of the frame's points in less time than a fit takes, and only the best of it is fitted.

The score is the fit's own energy of what the limb changes: every point on the capsule that claims it, robust,
and of the part that it looks like; and the limb out of what was seen through.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Float, Float32
from enliven_edge.parts.proposals import Seen
from enliven_edge.tracking import model, ranges
from enliven_edge.tracking.kinematics import deviation, exponential, product, shrug
from enliven_edge.tracking.limbs import LIMBS
from enliven_edge.tracking.observation import Observation, nearest_pixel
from enliven_edge.tracking.posture import Posture, forward
from enliven_edge.tracking.settings import FitSettings
from enliven_edge.tracking.terms import THICK, robust

_POINTS = 120
"""Of the frame's, that a limb is judged by."""
_WIDTH = 0.10
"""Metres at which residuals are doubted, wider than the fit's: a posture of the bank is only near."""
_SIDE = 0.04
"""Metres; see :func:`capsules.nearest_capsules`."""
_FREE_WIDTH, _SAMPLES = 0.25, 3
_SQUARE_CM = 1e4
_DISAGREEMENT = 4.0
"""Square centimetres that a point costs on a part that it does not look like."""
_HOPELESS = 2.0
"""Times the present score from which a posture is not worth being improved."""
_KEPT, _TRIES, _SPREAD = 4, 14, 0.3
"""Postures of the bank that are improved, small random turns tried for each, and radians of the first."""
_MOVED = 0.1
"""Metres that the limb's middle or end must go elsewhere for that to be another posture."""
_TURNS = np.random.default_rng(7).normal(size=(_KEPT, _TRIES, 3, 3))
_RAISED = {model.UPPER_ARM_L: 1.0, model.UPPER_ARM_R: -1.0}
"""Which way a shoulder rises with its arm; see :func:`kinematics.shrug`."""
_FAST = {"nsz", "arcp", "contract", "reassoc", "nnan", "ninf"}


class LimbSearch:
    """Where a limb may be instead, in one frame.

    Args:
        seen: what the forest says of the observation's points; None without one.
    """

    def __init__(self, observation: Observation, seen: Seen | None, settings: FitSettings) -> None:
        step = max(1, len(observation.points) // _POINTS)
        surface, _, self._view = observation.seen
        self._points: Float32 = np.ascontiguousarray(surface[:, ::step])
        self._unlike = np.zeros((len(model.CAPSULES.frame), self._points.shape[1]), np.float32)
        if seen is not None:
            self._unlike = np.ascontiguousarray(1.0 - seen.likelihood[::step].T)
        self._affinity = np.float32(settings.affinity)
        self._free = settings.free_space * _SQUARE_CM / len(model.CAPSULES.frame)

    def elsewhere(self, posture: Posture, frames: tuple[int, ...]) -> tuple[Posture, float]:
        """The posture with the limb where it explains the points best, and its score over the present one's.

        Below 1 it is better; 1 where nothing elsewhere is.
        """
        limb = LIMBS[frames]
        index = list(frames)
        ends, radii = posture.capsules()
        world, pivots, _ = forward(posture.position, posture.rotations, posture.lengths)
        parent = int(model.FRAME_PARENTS[frames[0]])
        base = np.full((2, self._points.shape[1]), 1e3, np.float32)
        _claims(base, self._points, self._unlike, ends, radii, limb.others, self._affinity)
        local = model.CAPSULES.ends[limb.capsules] @ posture.lengths
        hung = (*_offsets(frames, posture.lengths), world[parent], pivots[parent])
        surface = (local, radii[limb.capsules], limb.carriers)
        shown = (base, self._points, self._unlike[limb.capsules], self._affinity, self._view, self._free)
        allowed = (_hinges(frames), ranges.MIDDLE[index], ranges.REACH[index])
        best = np.ascontiguousarray(posture.rotations[index])
        score, present = _search(best, limb.bank, _TURNS, hung, surface, shown, allowed)
        made = posture.copy()
        made.rotations[index] = best
        return made, float(score / max(present, 1e-9))


def _offsets(frames: tuple[int, ...], lengths: Float) -> tuple[Float, Float, float]:
    """(len(frames), 3) where each bone begins in the one before; what a collar bone adds; which way it rises.

    The collar bone's part (3,), which rises with the arm, is not in the first.
    """
    offsets, side = model.PIVOTS[list(frames)] @ lengths, _RAISED.get(frames[0], 0.0)
    collar = np.zeros(3)
    if side:
        collar = model.PIVOTS[frames[0], :, model.SHOULDER] * lengths[model.SHOULDER]
        offsets[0] -= collar
    return offsets, collar, side


def _hinges(frames: tuple[int, ...]) -> Float:
    """(len(frames), 3) how far each axis is tried: a hinge turns about x alone."""
    return np.array([[1.0, 0.0, 0.0] if f in model.HINGES else [1.0, 1.0, 1.0] for f in frames])


@njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
def _claims(best, points, unlike, ends, radii, capsules, affinity):  # type: ignore[no-untyped-def]
    """Into best (2, N): the metres at which the nearest capsule claims each point, and what it costs there.

    The claim is that of :func:`capsules.nearest_capsules`, the cost cm^2: robust, and for looking different.
    """
    zero, one, side = np.float32(0.0), np.float32(1.0), np.float32(_SIDE)
    narrow, scale, odd = np.float32(1.0 / _WIDTH**2), np.float32(_SQUARE_CM), np.float32(_DISAGREEMENT)
    for k in range(len(capsules)):
        c = capsules[k]
        sx, sy, sz = np.float32(ends[c, 0, 0]), np.float32(ends[c, 0, 1]), np.float32(ends[c, 0, 2])
        dx, dy = np.float32(ends[c, 1, 0]) - sx, np.float32(ends[c, 1, 1]) - sy
        dz = np.float32(ends[c, 1, 2]) - sz
        share = one / (dx * dx + dy * dy + dz * dz + np.float32(1e-12))
        start, growth = np.float32(radii[c, 0]), np.float32(radii[c, 1] - radii[c, 0])
        for i in range(best.shape[1]):
            px, py, pz = points[0, i] - sx, points[1, i] - sy, points[2, i] - sz
            t = min(one, max(zero, (px * dx + py * dy + pz * dz) * share))
            px, py, pz = px - t * dx, py - t * dy, pz - t * dz
            length = np.sqrt(px * px + py * py + pz * pz) + np.float32(1e-9)
            facing = (px * points[3, i] + py * points[4, i] + pz * points[5, i]) / length
            distance = abs(length - (start + t * growth))
            claim = distance + side * max(zero, one - facing) + affinity * unlike[c, i]
            square = distance * distance
            cost = scale * square / (one + narrow * square) + odd * unlike[c, i]
            nearer = claim < best[0, i]
            best[1, i] = cost if nearer else best[1, i]
            best[0, i] = claim if nearer else best[0, i]


@njit(cache=True, nogil=True)
def _place(ends, reached, rotations, hung, surface):  # type: ignore[no-untyped-def]
    """The limb's (K, 2, 3) capsule ends, and (2, 3) where its middle joint and its end are, world frame."""
    offsets, collar, side, world, origin = hung
    local, _, carriers = surface
    pivot = origin.copy()
    for f in range(len(rotations)):
        x, y, z = offsets[f, 0], offsets[f, 1], offsets[f, 2]
        if f == 0 and side != 0.0:
            sine, cosine = shrug(rotations[0])
            x += cosine * collar[0] - side * sine * collar[1]
            y += side * sine * collar[0] + cosine * collar[1]
        for a in range(3):
            pivot[a] += world[a, 0] * x + world[a, 1] * y + world[a, 2] * z
        if f == 1:
            reached[0] = pivot
        world = product(world, rotations[f])
        for c in range(len(carriers)):
            if carriers[c] == f:
                for e in range(2):
                    x, y, z = local[c, e, 0], local[c, e, 1], local[c, e, 2]
                    for a in range(3):
                        ends[c, e, a] = pivot[a] + world[a, 0] * x + world[a, 1] * y + world[a, 2] * z
    reached[1] = ends[len(carriers) - 1, 1]


@njit(cache=True, nogil=True)
def _score(room, rotations, hung, surface, shown):  # type: ignore[no-untyped-def]
    """cm^2 a point that the frame costs with the limb turned so; where it is then, into room."""
    claims, ends, reached, every = room
    base, points, unlike, affinity, view, free = shown
    _place(ends, reached, rotations, hung, surface)
    claims[:] = base
    _claims(claims, points, unlike, ends, surface[1], every, affinity)
    return claims[1].mean() + _free_space(ends, surface[1], view, free)


@njit(cache=True, nogil=True)
def _free_space(ends, radii, view, weight):  # type: ignore[no-untyped-def]
    """cm^2: as :func:`terms.free_space` has it, without derivatives."""
    depth, mask, nearest, camera, pose = view
    height, width = depth.shape
    total = 0.0
    for c in range(len(ends)):
        for s in range(_SAMPLES):
            t = (s + 0.5) / _SAMPLES
            radius = radii[c, 0] + t * (radii[c, 1] - radii[c, 0])
            x, y, z = 0.0, 0.0, 0.0
            for b in range(3):
                offset = ends[c, 0, b] + t * (ends[c, 1, b] - ends[c, 0, b]) - pose[b, 3]
                x += pose[b, 0] * offset
                y += pose[b, 1] * offset
                z += pose[b, 2] * offset
            if z < 0.2:
                continue
            u = int(np.floor(camera[0] * x / z + camera[2] + 0.5))
            v = int(np.floor(camera[1] * y / z + camera[3] + 0.5))
            if u < 0 or v < 0 or u >= width or v >= height:
                continue
            seen = depth[v, u]
            if mask[v, u]:
                residual = seen - (z - radius) - 0.03
                if residual <= 0.0:
                    continue
            else:
                if seen == 0.0 or seen < z - radius + THICK:
                    continue
                near_v, near_u = nearest_pixel(v, u, nearest)
                if near_v < 0:
                    continue
                dx, dy = (u - near_u) * z / camera[0], (v - near_v) * z / camera[1]
                residual = np.sqrt(dx * dx + dy * dy)
            total += weight / _SAMPLES * robust(residual, _FREE_WIDTH)[0]
    return total


@njit(cache=True, nogil=True)
def _within(rotations, middle, reach):  # type: ignore[no-untyped-def]
    """Whether all bones are within their ranges."""
    for f in range(len(rotations)):
        turned = deviation(middle[f], rotations[f])
        for a in range(3):
            if abs(turned[a]) > reach[f, a]:
                return False
    return True


@njit(cache=True, nogil=True)
def _search(best, bank, noise, hung, surface, shown, allowed):  # type: ignore[no-untyped-def]
    """The best of the bank that is elsewhere, improved by small random turns: (its score, the present)."""
    axes, middle, reach = allowed
    count = len(surface[2])
    every = np.arange(count)
    there, reached = np.empty((2, 3)), np.empty((2, 3))
    claims, ends = np.empty_like(shown[0]), np.empty((count, 2, 3))
    present = _score((claims, ends, there, every), best, hung, surface, shown)
    room = (claims, ends, reached, every)
    scores = np.full(len(bank), 1e9)
    for k in range(len(bank)):
        value = _score(room, bank[k], hung, surface, shown)
        if _apart(there, reached) > _MOVED:
            scores[k] = value
    order = np.argsort(scores)
    lowest = present
    for n in range(len(noise)):
        kept, value, spread = bank[order[n]].copy(), scores[order[n]], _SPREAD
        if value > _HOPELESS * present:
            break
        for m in range(noise.shape[1]):
            tried = kept.copy()
            for f in range(len(kept)):
                tried[f] = product(kept[f], exponential(spread * axes[f] * noise[n, m, f]))
            other = _score(room, tried, hung, surface, shown)
            if other < value and _within(tried, middle, reach):
                kept, value = tried, other
            else:
                spread *= 0.9
        _score(room, kept, hung, surface, shown)
        if value < lowest and _apart(there, reached) > _MOVED:
            lowest = value
            best[:] = kept
    return lowest, present


@njit(cache=True, nogil=True)
def _apart(one, other):  # type: ignore[no-untyped-def]
    """Metres between two places of a limb: by its middle or its end, whichever is farther."""
    most = 0.0
    for k in range(2):
        x, y, z = one[k, 0] - other[k, 0], one[k, 1] - other[k, 1], one[k, 2] - other[k, 2]
        most = max(most, np.sqrt(x * x + y * y + z * z))
    return most
