"""Copies the motion of one limb to all equal limbs (see :mod:`enliven.matching.symmetry`).

    groups = find_equal_limbs(project.shape("squid").skeleton)            # enliven.matching.symmetry
    project = spread_motion(project, "squid", groups[0], joint, delay=0.1)

The motion is rotated or mirrored for each limb. Limb number k moves k times ``delay`` seconds later. Each
copy has its own layers that play the same takes, so it can be shifted, muted and weighted separately.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Layer, Project, Span, unused
from enliven.errors import InputError
from enliven.matching.symmetry import EqualLimbs
from enliven.rotation import canonical, from_matrix, multiply

_MIRROR_SIGNS = np.array([1.0, 1.0, -1.0, -1.0])
"""Factors of (w, x, y, z) that reflect a rotation in the plane x = 0."""


def spread_motion(
    project: Project, shape_id: str, group: EqualLimbs, joint: int, *, delay: float = 0.0
) -> Project:
    """Makes all limbs of a group move like the limb of ``joint``, and removes their own motion.

    Modeling rotations do not change.

    Args:
        group: result of :func:`enliven.matching.symmetry.find_equal_limbs` for the shape's skeleton.
        joint: any joint of the limb that has the motion.
        delay: seconds from each limb of the group to the next.

    Raises:
        InputError: if the joint belongs to no limb of the group, or the limb has no motion.
    """
    shape = project.shape(shape_id)
    own_limb = group.limb_of(joint)
    if own_limb < 0:
        limb_names = ", ".join(shape.skeleton.names[limb.joints[0]] for limb in group.limbs)
        problem = f"joint {shape.skeleton.names[joint]!r} belongs to no limb of the group"
        raise InputError(
            problem,
            where=f"shape {shape_id!r}",
            remedy=f"The limbs of the group begin at these joints: {limb_names}.",
        )
    used = dict.fromkeys(
        ref.layer for j in group.limbs[own_limb].joints for span in shape.spans[j] for ref in span.refs
    )
    if not used:
        problem = f"no take moves the limb that contains joint {shape.skeleton.names[joint]!r}"
        raise InputError(
            problem, where=f"shape {shape_id!r}", remedy="Bind a take to a chain of this limb first."
        )
    layers, spans = {layer.id: layer for layer in shape.layers}, list(shape.spans)
    used_names = dict(project.layer_names)
    for number in range(len(group.limbs)):
        if number == own_limb:
            continue
        later = delay * ((number - own_limb) % len(group.limbs))
        linear, fresh = group.get_map(own_limb, number), dict[str, str]()
        for name in used:
            fresh[name] = unused(name, used_names)
            used_names[fresh[name]] = None
            layers[fresh[name]] = reflect_layer(layers[name], linear, fresh[name], later)
        for start, end in group.joint_map(own_limb, number).items():
            if end != group.joint:
                spans[end] = tuple(_copy_span(span, fresh, linear) for span in shape.spans[start])
    return project.with_characters(shape.with_changes(spans=tuple(spans), layers=tuple(layers.values())))


def reflect_layer(layer: Layer, linear: Float, name: str, delay: float = 0.0) -> Layer:
    """Returns the layer with each of its rotations Q changed to L Q L^-1. L is ``linear``, a rotation or a
    reflection.

    A reflection is decomposed as L = R S, with the reflection S in the plane x = 0 and a rotation R. The
    layer's rotation is Q = B q B^-1, with its basis B and the take's rotation q. It becomes R (S B S) (S q S)
    (S B S)^-1 R^-1. The flag ``mirrored`` represents S q S.
    """
    mirrored, basis = layer.mirrored, layer.basis
    if np.linalg.det(linear) < 0.0:
        linear, mirrored, basis = linear * [-1.0, 1.0, 1.0], not mirrored, basis * _MIRROR_SIGNS
    turned = canonical(multiply(from_matrix(linear), basis))
    return replace(layer, id=name, basis=turned, mirrored=mirrored).add_delay(delay)


def _copy_span(span: Span, names: dict[str, str], linear: Float) -> Span:
    """Returns the span with other layers, and its fixed rotation turned with the limb."""
    x, y, z = (linear @ np.array(span.before[1:]) * np.linalg.det(linear)).tolist()
    refs = tuple(replace(ref, layer=names[ref.layer]) for ref in span.refs)
    return replace(span, refs=refs, before=(span.before[0], x, y, z))
