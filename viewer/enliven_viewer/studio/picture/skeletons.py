"""Skeletons as the renderer's tubes: bones that taper from parent to child, joints as balls."""

from __future__ import annotations

import itertools

import numpy as np

from enliven.arrays import Float, Float32
from enliven_viewer.render import linear_from_srgb
from enliven_viewer.render.overlay import tube_rows
from enliven_viewer.studio.viewport import Lens, Overlay, PosedShape, Selection
from enliven_viewer.theme import BONE, CHAINED, CHOSEN, FADED, HOVERED, ROOT

_BONE = 2.3
"""Pixels, radius of a bone at its parent: thin, so that the mesh is seen."""
_JOINT = 3.9
"""Pixels, radius of a joint: large enough to hit with the pointer."""
_ROOT = 5.4
"""Pixels, radius of the root, which moves the whole shape: larger than other joints."""


def skeleton_rows(posed: PosedShape, lens: Lens, selection: Selection, overlay: Overlay) -> Float32:
    """(N - 1 + N, 12) of ``Tubes``: a shape's bones, then its joints."""
    pixel = _metres_a_pixel(posed, lens)
    mine = selection.shape == posed.shape.id
    bones = np.tile(np.array(BONE if mine else FADED, float), (len(posed.joints), 1))
    joints = bones.copy()
    joints[0] = ROOT
    if overlay.chain is not None and overlay.chain[0] == posed.shape.id:
        _tint_chain(posed, overlay.chain[1], bones, joints)
    if mine and selection.joint is not None:
        bones[selection.joint] = joints[selection.joint] = CHOSEN
    if overlay.hovered is not None and overlay.hovered[0] == posed.shape.id:
        bones[overlay.hovered[1]] = joints[overlay.hovered[1]] = HOVERED
    starts, ends = posed.bones()
    rows = tube_rows(starts, ends, _BONE * pixel[1:], linear_from_srgb(bones[1:]))
    rows[:, 7] *= 0.42
    radii = np.full(len(joints), _JOINT)
    radii[0] = _ROOT
    return np.concatenate(
        [rows, tube_rows(posed.joints, posed.joints, radii * pixel, linear_from_srgb(joints))]
    )


def _tint_chain(posed: PosedShape, chain: tuple[int, ...], bones: Float32, joints: Float32) -> None:
    """Light the bones between neighbours of a chain."""
    parents = posed.shape.skeleton.parents
    for a, b in itertools.pairwise(chain):
        bones[b if parents[b] == a else a] = CHAINED
    joints[list(chain)] = CHAINED


def _metres_a_pixel(posed: PosedShape, lens: Lens) -> Float:
    """(N,) how much a pixel spans at each joint."""
    depth = np.maximum((posed.joints - lens.view.eye) @ lens.forward, 0.05)
    return np.asarray(2 * depth / (lens.view.clip_from_camera[1, 1] * lens.size[1]), np.float64)
