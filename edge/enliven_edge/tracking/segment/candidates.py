"""Candidates: blobs of pixels that may be a new person, observed until they are confirmed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.segment.candidate import Candidate, measure_blob
from enliven_edge.tracking.segment.person_shape import MAX_AREA_M2, MIN_AREA_M2, BlobShape, measure_shape
from enliven_edge.tracking.segment.pieces import Part, add_fragments, split_people, split_walls
from enliven_edge.tracking.segment.segmentation import Segments

_MAX_MOVEMENT_M = 0.45
"""Maximum movement of a candidate's centre between frames in metres: about the width of a person."""
_FORGET_AFTER_NS = 400_000_000
"""Time after which an unseen candidate is forgotten, in nanoseconds. So it survives a few bad frames."""
_MAX_GROUPS = 8
"""Maximum number of loose groups measured per frame, the largest first. It bounds the cost of a frame."""
_MAX_GROUPS_AT_FIRST = 16
"""Like ``_MAX_GROUPS``, while the background model is young. At that time large parts of the background are
loose groups.
"""
_REFUSED_RADIUS_M = 0.4
"""Horizontal radius in metres, about the size of furniture, around an object that was mistaken for a person.
No candidate is accepted there."""
_REFUSED_FOR_NS = 20_000_000_000
"""Nanoseconds for which candidates near such an object are rejected. The background model absorbs the object
sooner.
"""
_USUAL_AREA_M2 = 0.5
"""Approximate visible area of a person in square metres."""
_MIN_SPLIT_AREA_M2 = 0.45
"""Minimum visible area in square metres of a group that is split. A smaller group is a single person."""
_MIN_PART_PIXELS = 30
"""Minimum number of pixels of a measured part. Fewer have no shape."""


class Candidates:
    """All candidates, and the positions of objects that were mistaken for people."""

    def __init__(self) -> None:
        self._known: list[Candidate] = []
        self._refused: list[tuple[Float, int]] = []

    def clear(self) -> None:
        """Forgets all candidates and all such objects."""
        self._known.clear()
        self._refused.clear()

    def reject(self, place: Float, time_ns: int) -> None:
        """Rejects all candidates near ``place`` (3,) for a while, because an object there was mistaken for a
        person.
        """
        self._refused.append((place.copy(), time_ns))

    def drop(self, candidate: Candidate) -> None:
        """Removes a candidate that is now a tracked person."""
        self._known = [other for other in self._known if other is not candidate]

    @property
    def bystanders(self) -> int:
        """Returns the number of candidates that are confirmed people but may not perform."""
        return sum(1 for n in self._known if n.is_bystander and n.is_confirmed)

    def update(
        self,
        view: FrameView,
        kind: UInt8,
        segments: Segments,
        admits: Callable[[Float], bool],
        awaits: Callable[[Float], bool],
        *,
        young: bool,
    ) -> list[Candidate]:
        """Returns the candidates in this frame, the most person-like first.

        Args:
            view: the frame.
            kind: (h, w) from :meth:`BackgroundModel.classify`.
            segments: the segmentation of the frame.
            admits: returns True if a person at a (3,) place may perform.
            awaits: returns True if a person was lost near a (3,) place.
            young: whether the background model is new.
        """
        groups = [g for g in segments.loose if g.area > MIN_AREA_M2 and g.height > 0.3]
        groups = groups[: _MAX_GROUPS_AT_FIRST if young else _MAX_GROUPS]
        present = []
        for group in groups:
            same = next((n for n in self._known if n.is_unchanged(group, view.time_ns)), None)
            if same is not None:
                same.seen_ns = view.time_ns
                present.append(same)
                continue
            mask, shape = add_fragments(segments, group, view)
            if not mask.any():  # All pixels of the group belong to a known person again.
                continue
            bare = split_people(view.points, mask) if group.area > _MIN_SPLIT_AREA_M2 else [mask]
            parts: list[Part] = [(part, None) for part in bare]
            if young and group.area > _MIN_SPLIT_AREA_M2:
                shape = shape or measure_shape(view, mask, group.area)
                if not replace(shape, area=_USUAL_AREA_M2).may_be_person:
                    parts += split_walls(view, kind, mask)
            for part, walls in parts:
                if any(_mostly_overlaps(part, other.pixels) for other in present if other.is_convincing):
                    continue
                candidate = self._find_or_create(view, kind, part, walls, shape if part is mask else None)
                if candidate is not None and candidate not in present:
                    candidate.parts = bare if walls is None else []
                    candidate.is_bystander = not admits(candidate.centre)
                    candidate.is_awaited = awaits(candidate.centre)
                    candidate.group = group if len(parts) == 1 else None
                    present.append(candidate)
        self._known = [
            n for n in self._known if n in present or 0 <= view.time_ns - n.seen_ns < _FORGET_AFTER_NS
        ]
        return sorted(present, key=lambda n: -n.shape.likeness)

    def _find_or_create(
        self, view: FrameView, kind: UInt8, part: Bool, walls: Bool | None, shape: BlobShape | None
    ) -> Candidate | None:
        """Returns the existing or new candidate for a blob of pixels, or None if its size is not a person's.

        Args:
            view: the frame.
            kind: (h, w) from :meth:`BackgroundModel.classify`.
            part: (h, w) the blob.
            walls: (h, w) the pixels of walls behind it, or None.
            shape: shape of the group if it was measured before. Its area is replaced by that of the blob.
        """
        if np.count_nonzero(part) < _MIN_PART_PIXELS:
            return None
        centre, area, shares = measure_blob(view, part, kind)
        if not MIN_AREA_M2 < area < MAX_AREA_M2:
            return None
        shape = measure_shape(view, part, area, walls) if shape is None else replace(shape, area=area)
        # If walls were removed, every outline counts as free. Then the candidate must also have a head.
        if shape.likeness == 0 or (walls is not None and not shape.is_upright):
            return None
        unmatched = [n for n in self._known if n.seen_ns != view.time_ns]
        candidate = min(unmatched, key=lambda n: float(np.linalg.norm(n.centre - centre)), default=None)
        if candidate is None or np.linalg.norm(candidate.centre - centre) > _MAX_MOVEMENT_M:
            candidate = Candidate(centre, view.time_ns)
            self._known.append(candidate)
        candidate.is_rejected = self._is_refused(centre, view.time_ns)
        candidate.update(part, centre, shape, area, shares, view.time_ns)
        return candidate

    def _is_refused(self, centre: Float, time_ns: int) -> bool:
        """Returns True if an object near ``centre`` (3,) was recently mistaken for a person."""
        self._refused = [
            (refused_place, t) for refused_place, t in self._refused if 0 <= time_ns - t < _REFUSED_FOR_NS
        ]
        return any(
            float(np.linalg.norm((refused_place - centre)[[0, 2]])) < _REFUSED_RADIUS_M
            for refused_place, _ in self._refused
        )


def _mostly_overlaps(part: Bool, other: Bool) -> bool:
    """Returns True if more than half of a part's pixels also belong to ``other``."""
    return bool(np.count_nonzero(part & other) > 0.5 * np.count_nonzero(part))
