"""Retargeting edits (Project -> Project): apply the motion of a take to a shape, chain by chain (AniMesh,
section 5.2).

    bind_chain(project, shape_id, target, take_id, source, *, view=VIEW, up=UP, source_view=None,
               source_up=None, basis=None, flip=False, offset=0, speed=1, loop=False, weight=1,
               mirrored=False, layer_id=None)                  # adds a layer to the present ones
    clear_chain(project, shape_id, chain, layer_id=None)       # removes one layer, or all, from the bones
    copy_motion(project, from_shape, from_chain, to_shape, to_chain, ...)  # of enliven.motion.layers.copying
    set_travel(project, shape_id, layer_id or None, scale=None)  # root motion of that layer's take, or off
    extend_to_leaf(skeleton, joint)                             # the longest way down from a joint (Figure 5)
    branch(skeleton, start, end, extend=True)                  # from one joint through another, on to a leaf

A chain lists joints from the fixed end to the moving end. A chain with a single joint means the rotation of
this joint's bone: the chains (0,) and (0,) apply the rotation of the take's root to the shape's root.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.document import Clip, Layer, Project, Ref, RiggedCharacter, Skeleton, Span, unused
from enliven.errors import InputError
from enliven.motion.layers.basis import UP, VIEW, basis_from_views, first_bone
from enliven.motion.layers.polyline import arc_lengths, bones_along, is_downward
from enliven.motion.layers.travel import travel_scale


def bind_chain(
    project: Project,
    shape_id: str,
    target: Sequence[int],
    take_id: str,
    source: Sequence[int],
    *,
    view: AnyArray = VIEW,
    up: AnyArray = UP,
    source_view: AnyArray | None = None,
    source_up: AnyArray | None = None,
    basis: AnyArray | None = None,
    flip: bool = False,
    layer_id: str | None = None,
    **played: Any,
) -> Project:
    """Binds a chain of a shape to a chain of a take, in addition to the existing motion. Returns the edited
    project.

    Args:
        target: joints of the shape. Each is a child of the previous joint.
        source: consecutive joints of the take's skeleton.
        view: (3,) the viewing direction onto the target (and the source, unless ``source_view`` is given).
        up: (3,) the camera's up direction.
        basis: (4,) rotation from the source's axes to the target's axes. It replaces the basis from the view.
            The identity means that both have the same axes.
        flip: flips the y axis. It cannot be combined with ``basis``.
        layer_id: the new layer's name. None chooses an unused name.
        played: further fields of the :class:`Layer`: offset, speed, loop, weight, muted, mirrored, stretch.
            By default, ``stretch`` is True if the take's skeleton equals the shape's.

    Raises:
        InputError: if a shape, take or joint does not exist, or a chain is invalid.
    """
    shape = project.shape(shape_id)
    if take_id not in project.takes:
        advice = (
            f"Known takes: {', '.join(project.takes)}." if project.takes else "Record or import a take first."
        )
        raise InputError(f"the take {take_id!r} does not exist", where="project", remedy=advice)
    take_skeleton = project.takes[take_id].skeleton
    source = tuple(int(joint) for joint in source)
    bones_along(take_skeleton, source, where=f"take {take_id!r}")
    bones = check_downward_chain(shape, target)
    if basis is None:
        source_bone = first_bone(take_skeleton, source)
        if played.get("mirrored"):
            source_bone = source_bone * [-1.0, 1.0, 1.0]
        basis = basis_from_views(
            source_bone,
            first_bone(shape.skeleton, tuple(target)),
            view,
            up,
            flip=flip,
            source_view=source_view,
            source_up=source_up,
        )
    name = unused(take_id, project.layer_names) if layer_id is None else layer_id
    if any(layer.id == name for layer in shape.layers):
        raise InputError(f"a layer {name!r} exists already", where=shape.where, remedy="Choose another name.")
    played.setdefault("stretch", _is_own_clip(shape.skeleton, project.takes[take_id]))
    layer = Layer(name, take_id, source, basis, **played)
    arc = arc_lengths(shape.skeleton, target) if len(target) > 1 else [0.0, 1.0]
    spans = list(shape.spans)
    for bone, start, end in zip(bones, arc[:-1], arc[1:], strict=True):
        spans[bone] = _with_layer(spans[bone], name, float(start), float(end))
    return project.with_characters(shape.with_changes(spans=tuple(spans), layers=(*shape.layers, layer)))


def _is_own_clip(skeleton: Skeleton, take: Clip) -> bool:
    """Returns True if a take is a clip of this skeleton that moves or stretches its bones."""
    take_skeleton = take.skeleton
    is_same_skeleton = skeleton.names == take_skeleton.names and np.array_equal(
        skeleton.parents, take_skeleton.parents
    )
    return is_same_skeleton and take.has_deformation


def clear_chain(
    project: Project, shape_id: str, chain: Sequence[int], layer_id: str | None = None
) -> Project:
    """Removes a layer, or all layers if ``layer_id`` is None, from the bones of a chain of a shape. Returns
    the edited project.

    Layers without any remaining reference are deleted. Takes stay in the project.
    """
    shape = project.shape(shape_id)
    spans = list(shape.spans)
    for bone in check_downward_chain(shape, chain):
        spans[bone] = tuple(
            replace(span, refs=tuple(r for r in span.refs if layer_id is not None and r.layer != layer_id))
            for span in spans[bone]
        )
    return project.with_characters(shape.with_changes(spans=tuple(spans)))


def set_travel(project: Project, shape_id: str, layer_id: str | None, scale: float | None = None) -> Project:
    """Makes the root of a shape follow the root of a layer's take, or stay in place if ``layer_id`` is None.
    Returns the edited project.

    Args:
        scale: metres of the shape per metre of the take. None stores the current ratio of the sizes, so that
            cutting the shape later does not change its path.
    """
    shape = project.shape(shape_id)
    if layer_id is None:
        return project.with_characters(shape.with_changes(travel=None, travel_scale=None))
    clip = project.takes[shape.layer(layer_id).take]
    if scale is None:
        scale = travel_scale(shape.with_changes(travel_scale=None), clip)
    return project.with_characters(shape.with_changes(travel=layer_id, travel_scale=float(scale)))


def extend_to_leaf(skeleton: Skeleton, joint: int) -> tuple[int, ...]:
    """Returns the joints from ``joint``, included, along the longest branch down to a leaf (Figure 5,
    right).
    """
    depths = [0.0] * len(skeleton)
    for child in range(len(skeleton) - 1, 0, -1):
        parent = int(skeleton.parents[child])
        depths[parent] = max(depths[parent], depths[child] + float(skeleton.lengths[child]))
    chain = [int(joint)]
    while skeleton.children[chain[-1]]:
        chain.append(max(skeleton.children[chain[-1]], key=lambda j: depths[j] + float(skeleton.lengths[j])))
    return tuple(chain)


def chain_between(skeleton: Skeleton, start: int, end: int, *, extend: bool = True) -> tuple[int, ...]:
    """Returns the chain from ``start`` to ``end``. If ``extend`` is True, it continues along the longest
    branch below ``end``.
    """
    path = skeleton.path(start, end)
    return (*path, *extend_to_leaf(skeleton, end)[1:]) if extend and is_downward(skeleton, path) else path


def check_downward_chain(shape: RiggedCharacter, chain: Sequence[int]) -> list[int]:
    """Checks that a chain goes down the tree of a shape, and returns its bones. For a chain with a single
    joint, returns this joint's bone.

    Raises:
        InputError: if the chain goes up the tree, or its joints are not neighbours.
    """
    where, skeleton = f"shape {shape.id!r}", shape.skeleton
    bones = bones_along(skeleton, chain, where=where)
    if len(chain) == 1:
        return [int(chain[0])]
    if not is_downward(skeleton, chain):
        first_name, last_name = skeleton.names[chain[0]], skeleton.names[chain[-1]]
        if is_downward(skeleton, chain[::-1]):
            advice = (
                f"Pass the chain from {last_name!r} to {first_name!r}, so that it leads away from the root."
            )
        else:
            top = skeleton.names[min(chain)]
            advice = f"Pass two chains, one from {top!r} to each end."
        raise InputError(
            f"the chain from {first_name!r} to {last_name!r} leads towards the root of the skeleton",
            where=where,
            remedy=advice,
        )
    return bones


def _with_layer(spans: tuple[Span, ...], layer: str, start: float, end: float) -> tuple[Span, ...]:
    """Adds the interval [start, end] of a layer to the spans of a bone. Each span gets its part of the
    interval.
    """
    layered, fraction = [], 0.0
    for i, span in enumerate(spans):
        a = start + fraction * (end - start)
        fraction = 1.0 if i == len(spans) - 1 else fraction + span.share
        b = end if i == len(spans) - 1 else start + fraction * (end - start)
        layered.append(replace(span, refs=(*span.refs, Ref(layer, a, b))))
    return tuple(layered)
