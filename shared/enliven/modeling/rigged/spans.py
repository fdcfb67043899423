"""Spans of bones, split, joined and turned by the edits so that every take is kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Ref, Span
from enliven.rotation import IDENTITY, canonical, multiply, normalized

Spans = tuple[Span, ...]
AT_ONCE = (1.0, 0.0, 0.0, 0.0)
"""``before`` of a span that begins with no turn."""
_SLIVER = 1e-12
"""Shares below this are no part of a bone."""


def split_spans(spans: Spans, at: float) -> tuple[Spans, Spans]:
    """The spans of the two bones that a node at ``at`` in (0, 1) makes of one.

    The product of the turns of the two is the turn of the one, at every time: where the node falls inside a
    span, C(0)^-1 C(1) = C(0)^-1 C(v) C(v)^-1 C(1). What turns before the span stays with the upper bone.
    """
    upper, lower, done = [], [], 0.0
    whole = sum(span.share for span in spans)
    for span in spans:
        start, done = done, done + span.share / whole
        if done <= at + _SLIVER:
            upper.append(span)
        elif start >= at - _SLIVER:
            lower.append(span)
        else:
            first, second = _cut(span, (at - start) / (done - start))
            upper.append(first)
            lower.append(second)
    return _scaled(upper, 1.0), _scaled(lower, 1.0)


def riding(spans: Spans, layers: frozenset[str]) -> Spans:
    """The spans of a bone that goes on rigidly from one with ``spans``: it is stretched by these layers.

    A part of a layer that begins where it ends turns nothing.
    """
    refs = tuple(replace(ref, start=ref.end) for ref in spans[-1].refs if ref.layer in layers)
    return (Span(refs=refs),)


def joined_spans(upper: Spans, lower: Spans, share: float, between: Float = IDENTITY) -> Spans:
    """The spans of one bone that turns as two did, one after the other.

    Args:
        share: of the new bone's length that the upper bone had, in [0, 1].
        between: (4,) the modeling rotation of the lower bone: it turns after the upper bone's spans.

    Returns:
        Spans with the product (product of ``upper``) ``between`` (product of ``lower``) at every time. Two
        spans that were parts of one are one again.
    """
    first = lower[0]
    turned = multiply(between, np.array(first.before))
    lower = (replace(first, before=as_before(turned)), *lower[1:])
    return _merged((*_scaled(upper, share), *_scaled(lower, 1.0 - share)))


def before(spans: Spans) -> Float:
    """(4,) the turn of a bone that no take moves: the product of what is fixed in its spans."""
    turn = IDENTITY
    for span in spans:
        turn = multiply(turn, np.array(span.before))
    return turn


def moves(spans: Spans) -> bool:
    """Whether any layer turns the bone."""
    return any(span.refs for span in spans)


def as_before(turn: Float) -> tuple[float, float, float, float]:
    """A rotation in a span's form; exactly the identity where it differs by rounding only."""
    w, x, y, z = canonical(normalized(turn)).tolist()
    if abs(x) + abs(y) + abs(z) < _SLIVER:
        return AT_ONCE
    return w, x, y, z


def _cut(span: Span, at: float) -> tuple[Span, Span]:
    """The part of a span up to ``at`` in (0, 1) of it, and the rest."""
    middles = [ref.start + at * (ref.end - ref.start) for ref in span.refs]
    first = tuple(replace(ref, end=middle) for ref, middle in zip(span.refs, middles, strict=True))
    second = tuple(replace(ref, start=middle) for ref, middle in zip(span.refs, middles, strict=True))
    upper = replace(span, share=at * span.share, refs=first)
    return upper, Span((1.0 - at) * span.share, second)


def _scaled(spans: Sequence[Span], whole: float) -> Spans:
    """The spans with shares that sum to ``whole``; a bone without spans is still."""
    total = sum(span.share for span in spans)
    if not spans or total <= 0.0:
        # Only turns at the joint itself: the rest of the bone is still.
        return (*spans, Span(whole))
    return tuple(replace(span, share=span.share * whole / total) for span in spans)


def _merged(spans: Spans) -> Spans:
    """The spans with neighbours that go on where the one before ends made one; shares sum to one."""
    kept = [spans[0]]
    for span in spans[1:]:
        if _goes_on(kept[-1], span):
            ends = tuple(
                replace(ref, end=after.end) for ref, after in zip(kept[-1].refs, span.refs, strict=True)
            )
            kept[-1] = replace(kept[-1], share=kept[-1].share + span.share, refs=ends)
        else:
            kept.append(span)
    return tuple(kept)


def _goes_on(first: Span, second: Span) -> bool:
    """Whether two spans are one: the same layers, on without a gap, as fast along the bone."""
    if second.before != AT_ONCE or len(first.refs) != len(second.refs):
        return False
    if not first.refs:
        return True
    return min(first.share, second.share) > 0 and all(
        _continues(a, b, first.share, second.share) for a, b in zip(first.refs, second.refs, strict=True)
    )


def _continues(a: Ref, b: Ref, first: float, second: float) -> bool:
    if a.layer != b.layer or abs(a.end - b.start) > _SLIVER:
        return False
    return bool(np.isclose((a.end - a.start) * second, (b.end - b.start) * first, rtol=1e-9, atol=1e-15))
