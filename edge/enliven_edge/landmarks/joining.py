"""The bodies of depth and those of colour, joined by how sure each is of every joint."""

from __future__ import annotations

import dataclasses

import numpy as np

from enliven.arrays import Float
from enliven.person import Body, Joint

_TRUNK = [Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER, Joint.HEAD]
_SAME_PERSON = 0.5
"""Metres between two trunks, at most, that may be one person's."""
_AGREE = 0.12
"""Metres: two places of a joint this near are one place seen twice; farther ones contradict each other."""


def join_people(depth: list[Body], colour: list[Body]) -> list[Body]:
    """The depth's bodies, each joined with the colour's body of the same person; nearest pairs first.

    People whom colour alone sees are left out: the depth's tracker says who there is.
    """
    pairs = sorted(
        (distance, i, k)
        for i, a in enumerate(depth)
        for k, b in enumerate(colour)
        if (distance := _apart(a, b)) < _SAME_PERSON
    )
    made, taken = list(depth), set[int]()
    joined = set[int]()
    for _, i, k in pairs:
        if i not in joined and k not in taken:
            made[i] = join(depth[i], colour[k])
            joined.add(i)
            taken.add(k)
    return made


def join(depth: Body, colour: Body) -> Body:
    """One person as both see them.

    Where both agree on a joint it is between them, by confidence, and surer than either says. Where they
    contradict each other it is where the surer one says, and less sure. What only one knows is the other's
    nothing. Identity, orientations and all else stay those of the depth's body.
    """
    ours, theirs = np.clip(depth.confidence, 0, 1), np.clip(colour.confidence, 0, 1)
    apart = np.linalg.norm(depth.joints - colour.joints, axis=1)
    agree = np.exp(-0.5 * (apart / _AGREE) ** 2)
    surer = theirs > ours
    between = theirs / np.maximum(ours + theirs, 1e-9)
    chosen = np.where(surer, 1.0, 0.0)
    share = np.where(theirs > 0, agree * between + (1 - agree) * chosen, 0.0)
    joints = depth.joints + share[:, None] * (colour.joints - depth.joints)
    both = 1.0 - (1.0 - ours) * (1.0 - theirs)
    contradicted = np.maximum(ours, theirs) - 0.5 * np.minimum(ours, theirs)
    confidence = agree * both + (1 - agree) * contradicted
    return dataclasses.replace(depth, joints=joints, confidence=np.clip(confidence, 0.0, 1.0))


def _apart(a: Body, b: Body) -> float:
    """Metres between two trunks, over the joints that both know."""
    known = np.array([a.confidence[j] > 0 and b.confidence[j] > 0 for j in _TRUNK])
    if not known.any():
        return float("inf")
    gap: Float = np.linalg.norm(a.joints[_TRUNK] - b.joints[_TRUNK], axis=1)
    return float(gap[known].mean())
