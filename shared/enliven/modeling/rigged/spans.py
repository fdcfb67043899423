"""Splits, joins and rotates the spans of bones in edits. A span is the part of a bone that rotates by the
same layers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Ref, Span
from enliven.rotation import IDENTITY, canonical, multiply, normalized

Spans = tuple[Span, ...]
NO_BLEND = (1.0, 0.0, 0.0, 0.0)
"""The identity rotation: ``before`` of a span that starts without a fixed rotation."""
_MIN_BONE_FRACTION = 1e-12
"""Minimum length of a span as a fraction of its bone. Shorter spans count as empty."""


def split_spans(spans: Spans, at: float) -> tuple[Spans, Spans]:
    """Splits the spans of a bone at a node at ``at`` in (0, 1), and returns the spans of the two new bones.

    The product of the two rotations equals the old rotation at every time. If the node falls inside a span,
    the span is split at the fraction v of its length. C(x) is the rotation of the layers at x, and C(0)^-1
    C(1) = C(0)^-1 C(v) C(v)^-1 C(1). The fixed rotation before the span stays with the upper bone.
    """
    upper, lower, end = [], [], 0.0
    total = sum(span.share for span in spans)
    for span in spans:
        start, end = end, end + span.share / total
        if end <= at + _MIN_BONE_FRACTION:
            upper.append(span)
        elif start >= at - _MIN_BONE_FRACTION:
            lower.append(span)
        else:
            first, second = _split_span(span, (at - start) / (end - start))
            upper.append(first)
            lower.append(second)
    return _scale_shares(upper, 1.0), _scale_shares(lower, 1.0)


def rigid_continuation(spans: Spans, layers: frozenset[str]) -> Spans:
    """Returns the spans of a bone that stays in line with the bone before it, which has ``spans``. The new
    bone is stretched by ``layers``.

    Each reference to a layer has equal start and end, so that it causes no rotation.
    """
    refs = tuple(replace(ref, start=ref.end) for ref in spans[-1].refs if ref.layer in layers)
    return (Span(refs=refs),)


def join_consecutive_spans(
    upper: Spans, lower: Spans, upper_fraction: float, between: Float = IDENTITY
) -> Spans:
    """Returns the spans of one bone that replaces two consecutive bones.

    Args:
        upper_fraction: fraction of the new bone's length that the upper bone had, in [0, 1].
        between: (4,) the modeling rotation of the lower bone, applied after the upper bone's spans.

    Returns:
        Spans with the product (product of ``upper``) ``between`` (product of ``lower``) at every time. Two
        adjacent parts of one span are merged.
    """
    first = lower[0]
    turned = multiply(between, np.array(first.before))
    lower = (replace(first, before=compute_exact_rotation(turned)), *lower[1:])
    return _merge_neighbours(
        (*_scale_shares(upper, upper_fraction), *_scale_shares(lower, 1.0 - upper_fraction))
    )


def rotation_without_takes(spans: Spans) -> Float:
    """Returns the rotation (4,) of a bone without takes: the product of the fixed rotations of its spans."""
    turn = IDENTITY
    for span in spans:
        turn = multiply(turn, np.array(span.before))
    return turn


def has_motion(spans: Spans) -> bool:
    """Returns True if any layer rotates the bone."""
    return any(span.refs for span in spans)


def compute_exact_rotation(turn: Float) -> tuple[float, float, float, float]:
    """Returns a rotation (w, x, y, z) as a tuple, as spans store it. A rotation that differs from the
    identity only by rounding becomes the exact identity."""
    w, x, y, z = canonical(normalized(turn)).tolist()
    if abs(x) + abs(y) + abs(z) < _MIN_BONE_FRACTION:
        return NO_BLEND
    return w, x, y, z


def _split_span(span: Span, at: float) -> tuple[Span, Span]:
    """Returns the two parts of a span that is split at the fraction ``at`` in (0, 1) of its length."""
    middles = [ref.start + at * (ref.end - ref.start) for ref in span.refs]
    first = tuple(replace(ref, end=middle) for ref, middle in zip(span.refs, middles, strict=True))
    second = tuple(replace(ref, start=middle) for ref, middle in zip(span.refs, middles, strict=True))
    upper = replace(span, share=at * span.share, refs=first)
    return upper, Span((1.0 - at) * span.share, second)


def _scale_shares(spans: Sequence[Span], target_sum: float) -> Spans:
    """Scales the spans' shares (fractions of the bone's length) to the sum ``target_sum``. A bone without
    spans gets a span without motion."""
    total = sum(span.share for span in spans)
    if not spans or total <= 0.0:
        # All rotations are at the joint itself. So add one span without motion for the whole bone.
        return (*spans, Span(target_sum))
    return tuple(replace(span, share=span.share * target_sum / total) for span in spans)


def _merge_neighbours(spans: Spans) -> Spans:
    """Merges neighbouring spans if the second continues the first. The shares sum to one."""
    merged = [spans[0]]
    for span in spans[1:]:
        if _forms_one_span(merged[-1], span):
            ends = tuple(
                replace(ref, end=after.end) for ref, after in zip(merged[-1].refs, span.refs, strict=True)
            )
            merged[-1] = replace(merged[-1], share=merged[-1].share + span.share, refs=ends)
        else:
            merged.append(span)
    return tuple(merged)


def _forms_one_span(first: Span, second: Span) -> bool:
    """Returns True if two spans form one span: same layers, no gap, and the same rate along the bone."""
    if second.before != NO_BLEND or len(first.refs) != len(second.refs):
        return False
    if not first.refs:
        return True
    return min(first.share, second.share) > 0 and all(
        _is_continuation(a, b, first.share, second.share)
        for a, b in zip(first.refs, second.refs, strict=True)
    )


def _is_continuation(a: Ref, b: Ref, first: float, second: float) -> bool:
    if a.layer != b.layer or abs(a.end - b.start) > _MIN_BONE_FRACTION:
        return False
    return bool(np.isclose((a.end - a.start) * second, (b.end - b.start) * first, rtol=1e-9, atol=1e-15))
