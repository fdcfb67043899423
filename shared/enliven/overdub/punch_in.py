"""Punch-in: a recording replaces the existing motion only between its begin and its end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from enliven.document import LayerBase, Project, Ref, Segment, unused

FADE_S = 0.1
"""Duration, seconds, of the cross-fade between a recording and the motion that it replaces. It is long enough
to hide jumps, and shorter than a beat of a performance."""
_HELD_CLIP_SPEED = 1e-9
"""Speed, in seconds of the take per second of the lane, of a clip that shows a single frame. It is not 0,
because a speed of 0 is invalid."""
_MIN_CLIP_S = 1e-3
"""Minimum length of a clip, seconds. A shorter clip would not show any frame of a take."""
_Layer = TypeVar("_Layer", bound=LayerBase)


@dataclass(frozen=True)
class PunchIn:
    """The time span of a recording.

    Attributes:
        begin, end: seconds of the project.
        until: end of the project's content, seconds.
    """

    begin: float
    end: float
    until: float

    @classmethod
    def from_interval(cls, project: Project, begin: float, end: float) -> PunchIn:
        """Creates a time span in a project. ``until`` is set to the end of all content of the project."""
        end_times = (project.end_of(character) for character in project.characters.values())
        return cls(begin, end, max([end, *end_times]))

    def __call__(self, project: Project, layer: _Layer) -> _Layer | None:
        """Returns the layer with clips that mute it within the span. Returns None if no motion is left.

        Outside the span, the layer plays as before. A muted layer is returned unchanged. If the layer freezes
        its first and last frames (``hold``), these frames become clips. At the ends of the span, the layer
        fades over :data:`FADE_S`, or over its own ``ease`` if it does not freeze frames.
        """
        if layer.muted:
            return layer
        if layer.weights or layer.speeds:
            even = replace(
                self,
                begin=layer.convert_to_unwarped_time(self.begin),
                end=layer.convert_to_unwarped_time(self.end),
                until=layer.convert_to_unwarped_time(self.until),
            )
            kept_lane: list[_Layer | None] = []

            def lane(plain: _Layer) -> _Layer:
                kept_lane.append(even(project, plain))
                return kept_lane[0] or plain

            changed = layer.with_lane(lane)
            return None if kept_lane[0] is None else changed
        ease = min(FADE_S if layer.hold else layer.ease, self._half_length)
        low, high = self.begin + ease, self.end - ease
        segments_before, segments_after = list[Segment](), list[Segment]()
        for clip in self._layer_clips(layer, project.length_of(layer), ease):
            if min(clip.end, low) - clip.begin > _MIN_CLIP_S:
                segments_before.append(replace(clip, end=min(clip.end, low)))
            start = max(clip.begin, high)
            if clip.end - start > _MIN_CLIP_S:
                segments_after.append(replace(clip, begin=start, first=clip.compute_take_time(start)))
        # Keep the earlier motion only if some of it is outside the fades.
        first = min(self.begin, self.until) - _MIN_CLIP_S
        has_earlier_motion = (
            any(clip.begin < first and clip.end > _MIN_CLIP_S for clip in segments_before) and first > 0.0
        )
        remaining = segments_before if has_earlier_motion else []
        last = self.end + _MIN_CLIP_S
        has_earlier_motion = any(
            clip.end > last and clip.begin < self.until - _MIN_CLIP_S for clip in segments_after
        )
        remaining = [*remaining, *(segments_after if has_earlier_motion and self.until > last else [])]
        if not remaining:
            return None
        silenced = layer.with_clips(_sort_clips(remaining), project.length_of(layer))
        changes: dict[str, Any] = {"loop": False, "hold": False, "ease": ease}
        return replace(silenced, **changes)  # type: ignore[type-var]

    def moves_outside(self, project: Project, layers: Sequence[LayerBase]) -> bool:
        """Returns True if the layers have any motion outside of the span."""
        return any(not layer.muted and self(project, layer) is not None for layer in layers)

    @property
    def playback_settings(self) -> dict[str, Any]:
        """The time map fields of a recording's layer that plays only within the span."""
        return {"hold": False, "ease": min(FADE_S, self._half_length)}

    @property
    def _half_length(self) -> float:
        return (self.end - self.begin) / 2.0

    def _layer_clips(self, layer: LayerBase, length: float, ease: float) -> list[Segment]:
        """Returns the clips of a layer in the order of time. Repetitions of loops and frozen frames become
        clips, too.
        """
        clips = list(layer.clips(length))
        if layer.loop:
            lasts = layer.compute_loop_duration(length)
            start, ease = clips[0].begin, ease + _MIN_CLIP_S
            first = math.floor((-ease - start) / lasts) if layer.hold and lasts > 0.0 else 0
            rounds = range(first, math.ceil((self.until + ease - start) / lasts)) if lasts > 0.0 else (0,)
            clips = [
                replace(clip, begin=clip.begin + k * lasts, end=clip.end + k * lasts)
                for k in rounds
                for clip in clips
            ]
        if layer.loop or not layer.hold:
            return clips
        lead_in = Segment(
            min(0.0, clips[0].begin) - ease - _MIN_CLIP_S, clips[0].begin, clips[0].first, _HELD_CLIP_SPEED
        )
        extended = [lead_in]
        for clip, end in zip(clips, [*(c.begin for c in clips[1:]), self.until + ease], strict=True):
            extended.append(clip)
            if end > clip.end + _MIN_CLIP_S:
                extended.append(Segment(clip.end, end, clip.last, _HELD_CLIP_SPEED))
        return extended


def _sort_clips(clips: Sequence[Segment]) -> list[Segment]:
    """Returns clips sorted by begin and end. If the span cuts two blended clips at the same time, their times
    are moved apart slightly.
    """
    separated_clips = list[Segment]()
    for clip in clips:
        if separated_clips and clip.end <= separated_clips[-1].end:
            clip = replace(clip, end=separated_clips[-1].end + _MIN_CLIP_S)
        if separated_clips and clip.begin <= separated_clips[-1].begin:
            start = separated_clips[-1].begin + _MIN_CLIP_S
            clip = replace(clip, begin=start, first=clip.compute_take_time(start))
        separated_clips.append(clip)
    return separated_clips


def punch_bones(project: Project, shape_id: str, chain: Sequence[int], punch: PunchIn) -> Project:
    """Mutes the layers on the bones of a chain within a span. Returns the edited project.

    On other bones, the layers do not change. A layer without remaining motion is removed from the bones of
    the chain. Its take stays in the project.

    Args:
        chain: joints of the shape. Each is a child of the previous joint.
    """
    shape = project.shape(shape_id)
    bones = chain[1:] if len(chain) > 1 else chain
    names = {ref.layer for bone in bones for span in shape.spans[bone] for ref in span.refs}
    spans, layers, used_names = list(shape.spans), list(shape.layers), dict(project.layer_names)
    instead = dict[str, str]()
    for layer in shape.layers:
        remaining = punch(project, layer) if layer.id in names else None
        if remaining is layer:
            instead[layer.id] = layer.id
        elif remaining is not None:
            instead[layer.id] = unused(layer.id, used_names)
            used_names[instead[layer.id]] = None
            layers.append(replace(remaining, id=instead[layer.id]))
    for bone in bones:
        spans[bone] = tuple(
            replace(
                span,
                refs=tuple(_rename_reference(ref, instead) for ref in span.refs if ref.layer in instead),
            )
            for span in spans[bone]
        )
    shape = shape.with_changes(spans=tuple(spans), layers=tuple(layers))
    return project.with_characters(shape)


def _rename_reference(ref: Ref, names: dict[str, str]) -> Ref:
    return replace(ref, layer=names[ref.layer])
