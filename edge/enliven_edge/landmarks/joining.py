"""Joins the bodies of depth and those of colour by the confidence of every joint."""

from __future__ import annotations

import dataclasses

import numpy as np

from enliven.arrays import Float
from enliven.person import Body, Joint

_TRUNK = [Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER, Joint.HEAD]
_SAME_PERSON = 0.5
"""Metres between two trunks of one person, at most."""
_AGREE = 0.12
"""Metres: two places of a joint this near are one place seen twice; farther ones contradict each other."""


def join_people(depth: list[Body], colour: list[Body]) -> list[Body]:
    """Returns the depth's bodies, each joined with the colour's body of the same person; nearest pairs first.

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
    """Joins two bodies of one person.

    Where both agree on a joint it lies between them, weighted by confidence, and surer than either. Where
    they contradict each other the surer one is taken, with less confidence. A joint that only one has is
    taken from it. Identity, orientations and all else are those of the depth's body.
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
    """Returns metres between two trunks, over the joints that both have."""
    known = np.array([a.confidence[j] > 0 and b.confidence[j] > 0 for j in _TRUNK])
    if not known.any():
        return float("inf")
    gap: Float = np.linalg.norm(a.joints[_TRUNK] - b.joints[_TRUNK], axis=1)
    return float(gap[known].mean())
