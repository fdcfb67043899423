"""A performer who moves as somebody was captured: every limb points where theirs did, in its own proportions.

Bone directions turn the limbs; the plane in which an elbow or a knee bends turns them about their length, and
where they are straight the trunk does. The soles are put on the floor where the captured ones were.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.formats.capture import Capture
from enliven.rotation import from_matrix, nearest_rotation, rotate, slerp, swing, to_matrix
from enliven_edge.synthesis.capture_roles import Roles, find_roles
from enliven_edge.synthesis.performer import Figure, Limb, Performer

_UP, _DOWN, _FORWARD = np.array([0.0, 1.0, 0.0]), np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])
_SETTLE = 0.06
"""Seconds over which corrections of the height are smoothed."""


class Captured:
    """A motion capture danced by a performer; it begins at the world's origin, facing +Z.

    Args:
        performer: who dances it.
        capture: what was captured.
        start, stop: seconds of it; None for its end.

    Attributes:
        duration: seconds.

    Raises:
        InputError: where the capture has no hips, knees, elbows or head.
    """

    def __init__(
        self, performer: Performer, capture: Capture, start: float = 0.0, stop: float | None = None
    ) -> None:
        roles = find_roles(capture)
        rotations, standing = limb_rotations(capture, roles)
        pelvis = _pelvis_path(performer, capture, roles, rotations, standing)
        first = round(start / capture.seconds)
        last = capture.frames if stop is None else min(round(stop / capture.seconds) + 1, capture.frames)
        rotations, pelvis = rotations[first:last], pelvis[first:last]
        facing = rotations[: max(1, round(0.3 / capture.seconds)), Limb.PELVIS, :, 2].mean(0)
        level = to_matrix(swing(_level(facing), _FORWARD))
        self._rotations = from_matrix(level @ rotations)
        self._pelvis = (pelvis - pelvis[0] * [1.0, 0.0, 1.0]) @ level.T
        self._performer, self._seconds = performer, capture.seconds
        self.duration = (len(pelvis) - 1) * capture.seconds

    def figure(self, time: float) -> Figure:
        """The figure at a time in seconds; before the start and after the end it stands still."""
        at = min(max(time / self._seconds, 0.0), len(self._pelvis) - 1.0)
        before = min(int(at), max(len(self._pelvis) - 2, 0))
        after, part = min(before + 1, len(self._pelvis) - 1), at - before
        pelvis = (1.0 - part) * self._pelvis[before] + part * self._pelvis[after]
        turned = slerp(self._rotations[before], self._rotations[after], np.full(16, part))
        return self._performer.figure(to_matrix(turned), pelvis)


def limb_rotations(capture: Capture, roles: Roles) -> tuple[Float, Bool]:
    """(F, 16, 3, 3) world_from_limb in every frame; (F, 2) whether each foot stands."""
    p = capture.positions
    at = lambda pair: p[:, list(pair)]  # noqa: E731  (F, 2, 3)
    shoulders, elbows, wrists, tips = (
        at(r) for r in (roles.shoulders, roles.elbows, roles.wrists, roles.tips)
    )
    hips, knees, ankles, toes = (at(r) for r in (roles.hips, roles.knees, roles.ankles, roles.toes))
    low, top = hips.mean(1), shoulders.mean(1)
    middle = half_way(np.concatenate([low[:, None], p[:, list(roles.spine)], top[:, None]], 1))
    out = np.empty((capture.frames, 16, 3, 3))
    across_hips, across_shoulders = hips[:, 0] - hips[:, 1], shoulders[:, 0] - shoulders[:, 1]
    out[:, Limb.PELVIS] = _axes(middle - low, across_hips)
    out[:, Limb.CHEST] = _axes(top - middle, across_shoulders)
    out[:, Limb.ABDOMEN] = _axes(top - low, _unit(across_hips) + _unit(across_shoulders))
    out[:, Limb.SKULL] = _skull(out[:, Limb.CHEST], capture.rotations[:, roles.head])
    beyond = np.where(np.linalg.norm(tips - wrists, axis=-1, keepdims=True) > 1e-6, tips, 2 * wrists - elbows)
    standing = _standing(toes, ankles, capture.seconds, knees, hips)
    for side in (0, 1):
        hinge = _hinge(shoulders[:, side], elbows[:, side], wrists[:, side], out[:, Limb.CHEST], 1.0)
        out[:, Limb.UPPER_ARM_LEFT + side] = _axes(shoulders[:, side] - elbows[:, side], hinge)
        out[:, Limb.FOREARM_LEFT + side] = _axes(elbows[:, side] - wrists[:, side], hinge)
        out[:, Limb.HAND_LEFT + side] = _axes(wrists[:, side] - beyond[:, side], hinge)
        hinge = _hinge(hips[:, side], knees[:, side], ankles[:, side], out[:, Limb.PELVIS], -1.0)
        out[:, Limb.THIGH_LEFT + side] = _axes(hips[:, side] - knees[:, side], hinge)
        out[:, Limb.SHANK_LEFT + side] = _axes(knees[:, side] - ankles[:, side], hinge)
        shank = out[:, Limb.SHANK_LEFT + side, :, 0]
        out[:, Limb.FOOT_LEFT + side] = _foot(toes[:, side] - ankles[:, side], shank, standing[:, side])
    return out, standing


def _pelvis_path(
    performer: Performer, capture: Capture, roles: Roles, rotations: Float, standing: Bool
) -> Float:
    """(F, 3) metres: the performer's hip centre, scaled by the legs, the soles as high as the captured."""
    p = capture.positions
    hips, knees, ankles = (p[:, list(r)] for r in (roles.hips, roles.knees, roles.ankles))
    leg = np.linalg.norm(hips - knees, axis=-1) + np.linalg.norm(knees - ankles, axis=-1)
    scale = (performer.thigh + performer.shank) / float(np.median(leg))
    own = performer.hip * [0.0, 1.0, 1.0]
    pelvis = scale * hips.mean(1) - rotations[:, Limb.PELVIS] @ own
    wanted = _clearance(scale * p[:, list(roles.toes)], scale * ankles, standing)
    lowest = np.array(
        [performer.soles(performer.figure(r, at)).min() for r, at in zip(rotations, pelvis, strict=True)]
    )
    pelvis[:, 1] += _smoothed(wanted - lowest, _SETTLE / capture.seconds)
    return pelvis


def _clearance(toes: Float, ankles: Float, standing: Bool) -> Float:
    """(F,) metres from the floor to the lower foot; 0 where it is less than a few centimetres.

    Args:
        toes, ankles: (F, 2, 3) metres.
        standing: (F, 2) where that foot stands: there it is on the floor.
    """
    heights = []
    for side in (0, 1):
        for part in (toes, ankles):
            floor = np.median(part[standing[:, side], side, 1])
            heights.append(part[:, side, 1] - floor)
    low = np.maximum(np.min(heights, axis=0), 0.0)
    return np.asarray(low * _ramp(low, 0.03, 0.07))


def _standing(toes: Float, ankles: Float, seconds: float, knees: Float, hips: Float) -> Bool:
    """(F, 2) frames in which a foot is low and hardly moves; the best fifth of them at least."""
    leg = float(np.median(np.linalg.norm(hips - knees, axis=-1) + np.linalg.norm(knees - ankles, axis=-1)))
    speed = np.linalg.norm(np.gradient(toes, axis=0), axis=-1) / seconds / leg
    height = (toes[..., 1] + ankles[..., 1]) / leg
    badness = speed + 6.0 * (height - np.percentile(height, 3, axis=0))
    return np.asarray(badness <= np.maximum(np.percentile(badness, 20, axis=0), 0.25))


def half_way(path: Float) -> Float:
    """(F, 3) the point in the middle of each polyline (F, K, 3), by length."""
    steps = np.linalg.norm(np.diff(path, axis=1), axis=-1)
    upto = np.concatenate([np.zeros((len(path), 1)), np.cumsum(steps, 1)], 1)
    half = upto[:, -1:] / 2
    k = np.clip((upto <= half).sum(1) - 1, 0, path.shape[1] - 2)
    f = np.arange(len(path))
    part = (half[:, 0] - upto[f, k]) / np.maximum(steps[f, k], 1e-9)
    return np.asarray(path[f, k] + part[:, None] * (path[f, k + 1] - path[f, k]))


def _axes(up: Float, left: Float) -> Float:
    """(F, 3, 3) frames with +Y along ``up`` and +X as near to ``left`` as that allows."""
    y = _unit(up)
    x = _unit(left - (left * y).sum(-1, keepdims=True) * y)
    return np.stack([x, y, np.cross(x, y)], -1)


def _hinge(first: Float, middle: Float, last: Float, trunk: Float, sense: float) -> Float:
    """(F, 3) the axis about which a limb bends, pointing to the body's left; straight limbs ask the trunk.

    Args:
        trunk: (F, 3, 3) the frame that the limb hangs on.
        sense: 1 where the lower half bends forward (elbows), -1 backward (knees).
    """
    upper, lower = _unit(middle - first), _unit(last - middle)
    bent = sense * np.cross(lower, upper)
    carried = rotate(swing(trunk @ _DOWN, upper), trunk[:, :, 0])
    weight = _ramp(np.linalg.norm(bent, axis=-1), 0.1, 0.35)[:, None]
    return np.asarray(
        weight * bent / np.maximum(np.linalg.norm(bent, axis=-1, keepdims=True), 1e-9)
        + (1.001 - weight) * carried
    )


def _foot(along: Float, shank_left: Float, standing: Bool) -> Float:
    """(F, 3, 3) a foot that is level where it stands, whatever slope the captured one has there.

    Args:
        along: (F, 3) from the ankle to the toes.
        shank_left: (F, 3) the shank's +X: which way is left where the foot points up or down.
    """
    z = _unit(along)
    flat = np.hypot(z[:, 0], z[:, 2])
    weight = _ramp(flat, 0.4, 0.8)[:, None]
    left = weight * np.cross(_UP, z) / np.maximum(flat, 1e-9)[:, None] + (1.0 - weight) * shank_left
    x = _unit(left - (left * z).sum(-1, keepdims=True) * z)
    slope = float(np.median(np.arcsin(-z[standing, 1])))
    c, s = np.cos(slope), np.sin(slope)
    level = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    return np.asarray(np.stack([x, np.cross(z, x), z], -1) @ level)


def _skull(chest: Float, head: Float) -> Float:
    """(F, 3, 3) the head as its joint turns; over the whole capture it looks where the chest does."""
    usual = nearest_rotation((chest.transpose(0, 2, 1) @ head).mean(0))
    return np.asarray(head @ usual.T)


def _level(direction: Float) -> Float:
    return _unit(direction * [1.0, 0.0, 1.0])


def _unit(v: Float) -> Float:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12))


def _ramp(value: Float, low: float, high: float) -> Float:
    """0 up to ``low``, 1 from ``high``, smooth between."""
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def _smoothed(values: Float, width: float) -> Float:
    """(F,) means over a Gaussian of ``width`` frames."""
    reach = max(1, round(3 * width))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(width, 1e-6)) ** 2)
    return np.convolve(np.pad(values, reach, mode="edge"), kernel / kernel.sum(), mode="valid")
