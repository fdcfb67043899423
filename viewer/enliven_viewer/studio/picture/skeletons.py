"""Skeletons as the renderer's tubes: bones that taper from parent to child, joints as balls."""

from __future__ import annotations

import itertools

import numpy as np

from enliven.arrays import AnyArray, Float, Float32
from enliven_viewer.render import linear_from_srgb
from enliven_viewer.render.overlay import tube_rows
from enliven_viewer.studio.viewport import Lens, Overlay, Selection, StandingCharacter
from enliven_viewer.theme import BONE, CHAINED, CHOSEN, FADED, HOVERED, ROOT

_BONE = 2.3
"""Pixels, radius of a bone at its parent: thin, so that the mesh is seen."""
_JOINT = 3.9
"""Pixels, radius of a joint: large enough to hit with the pointer."""
_ROOT = 5.4
"""Pixels, radius of the root, which moves the whole shape: larger than other joints."""


_BONE_SHARE = 0.012
"""Largest radius of a bone over the size of the skeleton: from afar bones do not hide the surface."""
_JOINT_SHARE = 0.02
"""Largest radius of a joint over the size of the skeleton: a little thicker than a bone."""
_JOINT_OF_BONE = 0.45
"""Largest radius of a joint over the longest bone at it: those of a hand do not run into one another."""


def skeleton_rows(posed: StandingCharacter, lens: Lens, selection: Selection, overlay: Overlay) -> Float32:
    """(N - 1 + N, 12) of ``Tubes``: a character's bones, then its handles."""
    pixel = lens.spans(posed.handles)
    mine = posed.id in selection.characters
    bones = np.tile(np.array(BONE if mine else FADED, float), (len(posed.handles), 1))
    joints = bones.copy()
    joints[0] = ROOT
    if overlay.chain is not None and overlay.chain[0] == posed.id:
        _tint_chain(posed, overlay.chain[1], bones, joints)
    if selection.character == posed.id and selection.handle is not None:
        bones[selection.handle] = joints[selection.handle] = CHOSEN
    if overlay.hovered is not None and overlay.hovered[0] == posed.id:
        bones[overlay.hovered[1]] = joints[overlay.hovered[1]] = HOVERED
    above, below = np.array(posed.bones, np.int64).reshape(-1, 2).T
    starts, ends = posed.handles[above], posed.handles[below]
    size = float(np.ptp(posed.handles, axis=0).max()) if len(posed.handles) > 1 else np.inf
    thick = np.minimum(_BONE * pixel[below], _BONE_SHARE * size)
    rows = tube_rows(starts, ends, thick, linear_from_srgb(bones[below]))
    rows[:, 7] *= 0.42
    radii = np.full(len(joints), _JOINT)
    radii[0] = _ROOT
    most = _JOINT_SHARE * size * radii / _JOINT
    radii = np.minimum(
        radii * pixel, np.minimum(most, _JOINT_OF_BONE * _longest(posed.handles, above, below))
    )
    return np.concatenate([rows, tube_rows(posed.handles, posed.handles, radii, linear_from_srgb(joints))])


def _longest(handles: Float, above: AnyArray, below: AnyArray) -> Float:
    """Returns (H,) metres of the longest bone at each handle; infinite at one without a bone."""
    lengths = np.linalg.norm(handles[above] - handles[below], axis=1)
    longest = np.zeros(len(handles))
    np.maximum.at(longest, above, lengths)
    np.maximum.at(longest, below, lengths)
    return np.where(longest > 0.0, longest, np.inf)


def _tint_chain(posed: StandingCharacter, chain: tuple[int, ...], bones: Float32, joints: Float32) -> None:
    """Lights the bones between neighbours of a chain."""
    parents = posed.character.parents
    for a, b in itertools.pairwise(chain):
        bones[b if parents[b] == a else a] = CHAINED
    joints[list(chain)] = CHAINED
