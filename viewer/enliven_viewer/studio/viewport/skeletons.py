"""Makes skeletons as tubes for the renderer. Bones taper from parent to child, and joints are balls."""

from __future__ import annotations

import itertools

import numpy as np

from enliven.arrays import AnyArray, Float, Float32
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.overlay.tubes import make_tube_rows
from enliven_viewer.studio.viewport.overlay import Overlay
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.studio.viewport.selection import Selection
from enliven_viewer.studio.viewport.stage_character import StageCharacter
from enliven_viewer.theme import (
    CHAINED_BONE,
    HOVERED_JOINT,
    ROOT_JOINT,
    SELECTED_BONE,
    SELECTED_JOINT,
    UNSELECTED_BONE,
)

_BONE_RADIUS_PX = 2.3
"""Radius in pixels of a bone at its parent joint. It is thin, so that the mesh stays visible."""
_JOINT_RADIUS_PX = 3.9
"""Radius in pixels of a joint. It is large enough to hit with the pointer."""
_ROOT_RADIUS_PX = 5.4
"""Radius in pixels of the root joint. It is larger than other joints, because it moves the whole shape."""


_MAX_BONE_RADIUS = 0.012
"""Maximum radius of a bone as a fraction of the skeleton's size, so that distant bones do not hide the
surface.
"""
_MAX_JOINT_RADIUS = 0.02
"""Maximum radius of a joint as a fraction of the skeleton's size, slightly more than that of a bone."""
_MAX_JOINT_PER_BONE = 0.45
"""Maximum radius of a joint as a fraction of its longest bone, so that the joints of a hand do not
overlap.
"""


def make_skeleton_rows(posed: StageCharacter, lens: Lens, selection: Selection, overlay: Overlay) -> Float32:
    """Returns (N - 1 + N, 12) rows of ``Tubes``: a character's bones, then its handles."""
    pixel = lens.pixel_sizes(posed.handles)
    is_selected = posed.id in selection.characters
    bones = np.tile(
        np.array(SELECTED_BONE if is_selected else UNSELECTED_BONE, float), (len(posed.handles), 1)
    )
    joints = bones.copy()
    joints[0] = ROOT_JOINT
    if overlay.chain is not None and overlay.chain[0] == posed.id:
        _highlight_chain(posed, overlay.chain[1], bones, joints)
    if selection.character == posed.id and selection.handle is not None:
        bones[selection.handle] = joints[selection.handle] = SELECTED_JOINT
    if overlay.hovered is not None and overlay.hovered[0] == posed.id:
        bones[overlay.hovered[1]] = joints[overlay.hovered[1]] = HOVERED_JOINT
    above, below = np.array(posed.bones, np.int64).reshape(-1, 2).T
    starts, ends = posed.handles[above], posed.handles[below]
    size = float(np.ptp(posed.handles, axis=0).max()) if len(posed.handles) > 1 else np.inf
    thick = np.minimum(_BONE_RADIUS_PX * pixel[below], _MAX_BONE_RADIUS * size)
    rows = make_tube_rows(starts, ends, thick, linear_from_srgb(bones[below]))
    rows[:, 7] *= 0.42
    radii = np.full(len(joints), _JOINT_RADIUS_PX)
    radii[0] = _ROOT_RADIUS_PX
    max_radii = _MAX_JOINT_RADIUS * size * radii / _JOINT_RADIUS_PX
    radii = np.minimum(
        radii * pixel,
        np.minimum(max_radii, _MAX_JOINT_PER_BONE * _find_longest_bones(posed.handles, above, below)),
    )
    return np.concatenate(
        [rows, make_tube_rows(posed.handles, posed.handles, radii, linear_from_srgb(joints))]
    )


def _find_longest_bones(handles: Float, above: AnyArray, below: AnyArray) -> Float:
    """Returns the length (H,) in metres of the longest bone at each handle.

    The value is infinite at a handle without bones.
    """
    lengths = np.linalg.norm(handles[above] - handles[below], axis=1)
    longest = np.zeros(len(handles))
    np.maximum.at(longest, above, lengths)
    np.maximum.at(longest, below, lengths)
    return np.where(longest > 0.0, longest, np.inf)


def _highlight_chain(posed: StageCharacter, chain: tuple[int, ...], bones: Float32, joints: Float32) -> None:
    """Highlights the joints of a chain and the bones between them."""
    parents = posed.character.parents
    for a, b in itertools.pairwise(chain):
        bones[b if parents[b] == a else a] = CHAINED_BONE
    joints[list(chain)] = CHAINED_BONE
