"""Copies motion from one chain of bones to another chain of any length. All layers and spans are mapped by
arc length.

    copy_motion(project, from_shape, from_chain, to_shape, to_chain, *, view=VIEW, up=UP, basis=None,
                flip=False, delay=0.0, replaced=False)

The copy has its own layers, so that it can be shifted, muted or weighted independently of the original.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from enliven.arrays import AnyArray
from enliven.document import STILL, Layer, Project, Ref, RiggedCharacter, Span, unused
from enliven.motion.layers.basis import UP, VIEW, basis_from_views, first_bone
from enliven.motion.layers.polyline import arc_lengths
from enliven.motion.layers.retarget import check_downward_chain, clear_chain
from enliven.rotation import canonical, multiply

_EMPTY_PART_FRACTION = 1e-9
"""Maximum length of an empty piece, as a fraction of a bone."""


def copy_motion(
    project: Project,
    from_shape: str,
    from_chain: Sequence[int],
    to_shape: str,
    to_chain: Sequence[int],
    *,
    view: AnyArray = VIEW,
    up: AnyArray = UP,
    basis: AnyArray | None = None,
    flip: bool = False,
    delay: float = 0.0,
    replaced: bool = False,
) -> Project:
    """Copies the motion of one chain to another chain, in addition to its present motion. Returns the edited
    project.

    The total rotation along the chain is the same at every time. Each span of the source is mapped to the
    same arc length interval of the target. Modeling rotations stay unchanged.

    Args:
        view: (3,) the viewing direction that makes the two chains look similar (AniMesh, section 5.1).
        up: (3,) the camera's up direction.
        basis: (4,) rotation from the source to the target axes. It replaces the basis from the view.
        flip: flips the y axis. It cannot be combined with ``basis``.
        delay: delay of the copy in seconds.
        replaced: True removes the present motion of the target chain.

    Raises:
        InputError: if a shape or a chain does not exist, or a chain goes up the tree.
    """
    source, target = project.shape(from_shape), project.shape(to_shape)
    pieces = _chain_pieces(source, from_chain)
    check_downward_chain(target, to_chain)
    if basis is None:
        source_bone = first_bone(source.skeleton, tuple(from_chain))
        target_bone = first_bone(target.skeleton, tuple(to_chain))
        basis = basis_from_views(source_bone, target_bone, view, up, flip=flip)
    new_layers: dict[str, Layer] = {}
    for name in dict.fromkeys(ref.layer for _, _, refs in pieces for ref in refs):
        used_names = {**project.layer_names, **{layer.id: None for layer in new_layers.values()}}
        layer = source.layer(name)
        target_basis = canonical(multiply(basis, layer.basis))
        new_layers[name] = replace(layer, id=unused(name, used_names), basis=target_basis).add_delay(delay)
    if replaced:
        project = clear_chain(project, to_shape, to_chain)
        target = project.shape(to_shape)
    renamed = [(a, b, tuple(replace(r, layer=new_layers[r.layer].id) for r in refs)) for a, b, refs in pieces]
    return project.with_characters(_apply_along_chain(target, to_chain, renamed, tuple(new_layers.values())))


_Piece = tuple[float, float, tuple[Ref, ...]]
"""Start and end, as fractions of the length, and the layer references on this interval."""


def _chain_pieces(shape: RiggedCharacter, chain: Sequence[int]) -> list[_Piece]:
    """Returns the spans of a chain's bones in order, each with its interval of the chain's arc length."""
    pieces: list[_Piece] = []
    for bone, (start, end) in _bone_intervals(shape, chain):
        for a, b, span in _span_intervals(shape.spans[bone]):
            pieces.append((start + (end - start) * a, start + (end - start) * b, span.refs))
    return pieces


def _bone_intervals(shape: RiggedCharacter, chain: Sequence[int]) -> list[tuple[int, tuple[float, float]]]:
    """Returns the bones of a chain, each with its interval of the chain's arc length."""
    bones = check_downward_chain(shape, chain)
    arc = arc_lengths(shape.skeleton, chain).tolist() if len(chain) > 1 else [0.0, 1.0]
    return list(zip(bones, pairwise(arc), strict=True))


def _span_intervals(spans: tuple[Span, ...]) -> list[tuple[float, float, Span]]:
    """Returns every span with its interval of the bone."""
    bounds = np.cumsum([0.0, *(span.share for span in spans)])
    bounds = bounds / bounds[-1]
    return [(a, b, span) for (a, b), span in zip(pairwise(bounds.tolist()), spans, strict=True)]


def _apply_along_chain(
    shape: RiggedCharacter, chain: Sequence[int], pieces: list[_Piece], layers: tuple[Layer, ...]
) -> RiggedCharacter:
    """Applies ``pieces`` of ``layers`` along a chain of a shape, as the innermost layers.

    The shape's spans are split at the ends of the pieces.
    """
    spans = list(shape.spans)
    for bone, (start, end) in _bone_intervals(shape, chain):
        width = end - start
        bone_pieces = [((a - start) / width, (b - start) / width, refs) for a, b, refs in pieces if refs]
        spans[bone] = _overlay_spans(spans[bone], bone_pieces)
    return shape.with_changes(spans=tuple(spans), layers=(*shape.layers, *layers))


def _overlay_spans(spans: tuple[Span, ...], pieces: list[_Piece]) -> tuple[Span, ...]:
    """Combines the spans of a bone with the parts of the pieces within [0, 1]. Pieces may extend beyond this
    interval.
    """
    own_spans = _span_intervals(spans)
    bounds = [x for a, b, _ in own_spans for x in (a, b)] + [x for a, b, _ in pieces for x in (a, b)]
    cuts = _find_distinct_places([min(max(x, 0.0), 1.0) for x in bounds])
    overlaid: list[Span] = []
    for i, low in enumerate(cuts):
        # Copy the pieces of zero length at this position, which is a joint. At the end of a bone, such pieces
        # belong to the next bone.
        overlaid += [
            replace(span, share=0.0)
            for a, b, span in own_spans
            if b - a <= _EMPTY_PART_FRACTION and _are_equal(a, low)
        ]
        if i == len(cuts) - 1:
            break
        overlaid += [
            Span(0.0, refs) for a, b, refs in pieces if b - a <= _EMPTY_PART_FRACTION and _are_equal(a, low)
        ]
        high, middle = cuts[i + 1], (low + cuts[i + 1]) / 2
        a, b, span = next(piece for piece in own_spans if piece[0] < middle < piece[1])
        refs = [_cut_reference(ref, a, b, low, high) for ref in span.refs]
        refs += [
            _cut_reference(r, c, d, low, high)
            for c, d, piece_refs in pieces
            if c < middle < d
            for r in piece_refs
        ]
        overlaid.append(Span(high - low, tuple(refs), span.before if _are_equal(a, low) else STILL[0].before))
    return tuple(overlaid)


def _cut_reference(ref: Ref, start: float, end: float, low: float, high: float) -> Ref:
    """Cuts a reference on the interval [start, end] to [low, high]. Returns it unchanged if both intervals
    are equal.
    """
    width = (ref.end - ref.start) / (end - start)
    first = ref.start if _are_equal(start, low) else ref.start + (low - start) * width
    last = ref.end if _are_equal(end, high) else ref.start + (high - start) * width
    return Ref(ref.layer, first, last)


def _find_distinct_places(places: list[float]) -> list[float]:
    """Returns the positions in ascending order, without duplicates within the rounding tolerance. 0 and 1 are
    exact.
    """
    distinct = [0.0]
    for position in sorted(places):
        if position - distinct[-1] > _EMPTY_PART_FRACTION and position < 1.0 - _EMPTY_PART_FRACTION:
            distinct.append(position)
    return [*distinct, 1.0]


def _are_equal(a: float, b: float) -> bool:
    return abs(a - b) <= _EMPTY_PART_FRACTION
