"""Names of body parts that can attach to a mesh, such as "left arm", "upper body" or "hip +
right arm"."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

from enliven.errors import InputError
from enliven.person.joints import Joint

_SIDES = ("left", "right")


def _limb_joints(side: str, *names: str) -> frozenset[Joint]:
    return frozenset(Joint[f"{name}_{side.upper()}"] for name in names)


def _make_sided_parts() -> dict[str, frozenset[Joint]]:
    """Returns the parts that exist on both sides of the body, with their joints."""
    parts: dict[str, frozenset[Joint]] = {}
    for side in _SIDES:
        parts[f"{side} arm"] = _limb_joints(side, "SHOULDER", "ELBOW", "WRIST", "HAND")
        parts[f"{side} forearm"] = _limb_joints(side, "WRIST", "HAND")
        parts[f"{side} hand"] = _limb_joints(side, "HAND")
        parts[f"{side} leg"] = _limb_joints(side, "HIP", "KNEE", "ANKLE", "FOOT")
        parts[f"{side} shin"] = _limb_joints(side, "ANKLE", "FOOT")
        parts[f"{side} foot"] = _limb_joints(side, "FOOT")
        parts[f"{side} side"] = parts[f"{side} arm"] | parts[f"{side} leg"]
    return parts


def _list_all_parts() -> dict[str, frozenset[Joint]]:
    sided = _make_sided_parts()
    torso = frozenset({Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER, Joint.HEAD})
    arms, legs = sided["left arm"] | sided["right arm"], sided["left leg"] | sided["right leg"]
    hip = frozenset({Joint.HIP_CENTER})
    return {
        "all": frozenset(Joint),
        **sided,
        "arms": arms,
        "both arms": arms,
        "hands": sided["left hand"] | sided["right hand"],
        "legs": legs,
        "both legs": legs,
        "feet": sided["left foot"] | sided["right foot"],
        "head": frozenset({Joint.HEAD}),
        "hip": hip,
        "spine": torso - {Joint.HEAD},
        "torso": torso,
        "upper body": torso | arms,
        "lower body": legs | hip,
        "arms and legs": arms | legs,
        "hip and right arm": sided["right arm"] | hip,
        "hip and left arm": sided["left arm"] | hip,
    }


PARTS: dict[str, frozenset[Joint]] = _list_all_parts()
"""The joints of each body part by name, such as "left arm" or "upper body" (KinÊtre). A bone belongs to its
child joint."""

_SEPARATOR_PATTERN = re.compile(r"\s*(?:\+|,|&|\band\b)\s*")


def parse_parts(parts: str | Iterable[str]) -> frozenset[Joint]:
    """Returns the joints of body parts, given by names such as "all", "legs", "hip + right arm" or "left arm
    and head".

    Names are joined by "+", "&", "," or "and". Case and extra spaces do not matter.

    Raises:
        InputError: if a name is unknown. The message lists the known names.
    """
    names = [parts] if isinstance(parts, str) else list(parts)
    return frozenset().union(*(_parse_part(name) for name in names))


def _parse_part(name: str) -> frozenset[Joint]:
    """Returns the joints of one part name, or of several names in one string."""
    normalized = " ".join(name.lower().split())
    if normalized in PARTS:
        return PARTS[normalized]
    pieces = [piece for piece in _SEPARATOR_PATTERN.split(normalized) if piece]
    unknown = next((piece for piece in pieces if piece not in PARTS), None)
    if unknown is None and pieces:
        return frozenset().union(*(PARTS[piece] for piece in pieces))
    wrong_name = normalized if unknown is None else unknown
    similar = difflib.get_close_matches(wrong_name, PARTS, n=1)
    guess = f"Did you mean {similar[0]}? " if similar else ""
    raise InputError(
        f"no part of the body is called {wrong_name!r}",
        where="parts",
        remedy=f"{guess}Known parts: {', '.join(PARTS)}. Combine several parts with '+'.",
    )
