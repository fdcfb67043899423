"""Makes the labels of timeline rows (lanes): the limb that moves, then the take that it plays."""

from __future__ import annotations

import re

from enliven.document import LayerBase, RigBase, Shape

_PLAIN_WORDS = {"girdle": "shoulder", "trunk": "body", "whole": "whole body", "way": "path"}
"""The displayed words for limb names of the retargeting code."""
_LEG_WORDS = {"shoulder": "hip"}
"""The displayed word for a girdle to which legs are attached."""


def make_lane_name(character: RigBase, layer: LayerBase) -> str:
    """Returns the label of a layer's lane, such as "left arm, wave".

    A narrow lane shows only its beginning.
    """
    name = str(getattr(layer, "id", character.id))
    take, _, limb = name.partition(": ")
    if limb:
        return f"{describe_limb(limb)}, {take}"
    if not isinstance(character, Shape) or (name != layer.take and not name.startswith(f"{layer.take} ")):
        return name
    lanes_of_take = sum(other.take == layer.take for other in character.playing)
    limb = _find_driven_joint(character, name) if lanes_of_take > 1 else ""
    return f"{limb}, {name}" if limb else name


def describe_limb(role: str) -> str:
    """Returns a limb's name in an artist's words: "left hip" for "left leg 1 girdle"."""
    words = [word for word in role.split() if not re.fullmatch(r"1", word)]
    plain = [_PLAIN_WORDS.get(word, word) for word in words]
    if "shoulder" in plain:
        legs = any(word.startswith("leg") for word in plain)
        joint = _LEG_WORDS["shoulder"] if legs else "shoulder"
        sides = [word for word in plain if word in ("left", "right")]
        numbers = [word for word in plain if word.isdecimal()]
        return " ".join([*sides, joint, *numbers])
    return " ".join(plain)


def _find_driven_joint(shape: Shape, layer_id: str) -> str:
    """Returns the end joint of the bones that a layer drives, or an empty text if it drives all bones or
    none.
    """
    driven = [
        joint
        for joint, spans in enumerate(shape.spans)
        if any(ref.layer == layer_id for span in spans for ref in span.refs)
    ]
    if not driven or len(driven) >= len(shape.skeleton) - 1:
        return ""
    return shape.skeleton.names[driven[-1]].removesuffix(" end")
