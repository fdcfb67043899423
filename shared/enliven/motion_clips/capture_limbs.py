"""Computes the coordinate frames of a captured person's limbs from the joint positions."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.formats.motion.capture import Capture
from enliven.motion_clips.capture_roles import JointRoles
from enliven.person import Limb
from enliven.rotation import nearest_rotation, rotate, swing, unit

_UP, _DOWN, _FORWARD = np.array([0.0, 1.0, 0.0]), np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])


def find_limb_rotations(capture: Capture, roles: JointRoles) -> tuple[Float, Bool]:
    """Returns the rotation from each limb to the world in every frame (F, 16, 3, 3), and (F, 2) True for each
    standing foot."""
    p = capture.positions
    pair_positions = lambda pair: p[:, list(pair)]  # noqa: E731  (F, 2, 3)
    shoulders, elbows, wrists, tips = (
        pair_positions(r) for r in (roles.shoulders, roles.elbows, roles.wrists, roles.tips)
    )
    hips, knees, ankles, toes = (
        pair_positions(r) for r in (roles.hips, roles.knees, roles.ankles, roles.toes)
    )
    low, top = hips.mean(1), shoulders.mean(1)
    spine_middle = path_midpoint(np.concatenate([low[:, None], p[:, list(roles.spine)], top[:, None]], 1))
    rotations = np.empty((capture.frames, 16, 3, 3))
    across_hips, across_shoulders = hips[:, 0] - hips[:, 1], shoulders[:, 0] - shoulders[:, 1]
    rotations[:, Limb.PELVIS] = _limb_axes(spine_middle - low, across_hips)
    rotations[:, Limb.CHEST] = _limb_axes(top - spine_middle, across_shoulders)
    rotations[:, Limb.ABDOMEN] = _limb_axes(top - low, unit(across_hips) + unit(across_shoulders))
    # The head rotates with its joint. Assume that the head's average direction is that of the chest.
    head = capture.rotations[:, roles.head]
    usual = nearest_rotation((rotations[:, Limb.CHEST].transpose(0, 2, 1) @ head).mean(0))
    rotations[:, Limb.SKULL] = head @ usual.T
    hand_tips = np.where(
        np.linalg.norm(tips - wrists, axis=-1, keepdims=True) > 1e-6, tips, 2 * wrists - elbows
    )
    standing = _find_feet_on_floor(toes, ankles, capture.seconds, knees, hips)
    for side in (0, 1):
        hinge = _hinge_axis(
            shoulders[:, side], elbows[:, side], wrists[:, side], rotations[:, Limb.CHEST], 1.0
        )
        rotations[:, Limb.UPPER_ARM_LEFT + side] = _limb_axes(shoulders[:, side] - elbows[:, side], hinge)
        rotations[:, Limb.FOREARM_LEFT + side] = _limb_axes(elbows[:, side] - wrists[:, side], hinge)
        rotations[:, Limb.HAND_LEFT + side] = _limb_axes(wrists[:, side] - hand_tips[:, side], hinge)
        hinge = _hinge_axis(hips[:, side], knees[:, side], ankles[:, side], rotations[:, Limb.PELVIS], -1.0)
        rotations[:, Limb.THIGH_LEFT + side] = _limb_axes(hips[:, side] - knees[:, side], hinge)
        rotations[:, Limb.SHANK_LEFT + side] = _limb_axes(knees[:, side] - ankles[:, side], hinge)
        shank = rotations[:, Limb.SHANK_LEFT + side, :, 0]
        rotations[:, Limb.FOOT_LEFT + side] = _foot_frames(
            toes[:, side] - ankles[:, side], shank, standing[:, side]
        )
    return rotations, standing


def _find_feet_on_floor(toes: Float, ankles: Float, seconds: float, knees: Float, hips: Float) -> Bool:
    """Returns (F, 2) True for frames in which a foot is low and nearly still. At least a fifth of all frames
    is True.
    """
    leg = float(np.median(np.linalg.norm(hips - knees, axis=-1) + np.linalg.norm(knees - ankles, axis=-1)))
    speed = np.linalg.norm(np.gradient(toes, axis=0), axis=-1) / seconds / leg
    height = (toes[..., 1] + ankles[..., 1]) / leg
    badness = speed + 6.0 * (height - np.percentile(height, 3, axis=0))
    return np.asarray(badness <= np.maximum(np.percentile(badness, 20, axis=0), 0.25))


def path_midpoint(path: Float) -> Float:
    """Returns the point (F, 3) halfway along the length of each polyline (F, K, 3)."""
    steps = np.linalg.norm(np.diff(path, axis=1), axis=-1)
    upto = np.concatenate([np.zeros((len(path), 1)), np.cumsum(steps, 1)], 1)
    half_length = upto[:, -1:] / 2
    k = np.clip((upto <= half_length).sum(1) - 1, 0, path.shape[1] - 2)
    f = np.arange(len(path))
    fraction = (half_length[:, 0] - upto[f, k]) / np.maximum(steps[f, k], 1e-9)
    return np.asarray(path[f, k] + fraction[:, None] * (path[f, k + 1] - path[f, k]))


def _limb_axes(up: Float, left: Float) -> Float:
    """Returns coordinate frames (F, 3, 3) with +Y along ``up`` and +X as near to ``left`` as possible."""
    y = unit(up)
    x = unit(left - (left * y).sum(-1, keepdims=True) * y)
    return np.stack([x, y, np.cross(x, y)], -1)


def _hinge_axis(first: Float, middle: Float, last: Float, trunk: Float, sense: float) -> Float:
    """Returns the hinge axis (F, 3) of a limb, pointing to the body's left. For a straight limb, it is the
    left axis of the trunk.

    Args:
        trunk: (F, 3, 3) coordinate frame of the trunk part to which the limb is attached.
        sense: 1 if the joint bends the lower half forward (elbows), -1 if backward (knees).
    """
    upper, lower = unit(middle - first), unit(last - middle)
    bend_axis = sense * np.cross(lower, upper)
    trunk_axis = rotate(swing(trunk @ _DOWN, upper), trunk[:, :, 0])
    weight = smoothstep(np.linalg.norm(bend_axis, axis=-1), 0.1, 0.35)[:, None]
    return np.asarray(
        weight * bend_axis / np.maximum(np.linalg.norm(bend_axis, axis=-1, keepdims=True), 1e-9)
        + (1.001 - weight) * trunk_axis
    )


def _foot_frames(along: Float, shank_left: Float, standing: Bool) -> Float:
    """Returns the coordinate frames (F, 3, 3) of a foot. A standing foot is horizontal, even if the captured
    foot is tilted.

    Args:
        along: (F, 3) from the ankle to the toes.
        shank_left: (F, 3) the +X axis of the lower leg. It is used as left if the foot points up or down.
    """
    z = unit(along)
    flat = np.hypot(z[:, 0], z[:, 2])
    weight = smoothstep(flat, 0.4, 0.8)[:, None]
    left = weight * np.cross(_UP, z) / np.maximum(flat, 1e-9)[:, None] + (1.0 - weight) * shank_left
    x = unit(left - (left * z).sum(-1, keepdims=True) * z)
    slope = float(np.median(np.arcsin(-z[standing, 1])))
    c, s = np.cos(slope), np.sin(slope)
    level = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    return np.asarray(np.stack([x, np.cross(z, x), z], -1) @ level)


def smoothstep(value: Float, low: float, high: float) -> Float:
    """Returns 0 up to ``low``, 1 from ``high``, and a smooth transition (smoothstep) between them."""
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
