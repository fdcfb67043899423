"""Edits of the clips in a lane of the timeline, for the layers of all rigs.

    split_clip(project, "squid", [0], time)                   # the motion stays the same
    trim_clip(project, "squid", [0], 1, begin=2.0)            # the remaining part plays as before
    slip_clip(project, "squid", [0], 1, 0.5)                  # another part of the take, at the same time
    blend_clips(project, "squid", [0], 0, 0.4)                # cross-fades a clip into the next

A lane is a row of the timeline. It shows all layers of a character that have the same clips. Clips are
numbered in the order of time, and times are in seconds of the project. An invalid edit raises InputError and
changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from enliven.document import LayerBase, Project, RigBase, Segment
from enliven.errors import InputError
from enliven.modeling.edits.characters import change_layers

_MIN_CLIP_S = 1e-3
"""Minimum duration of a clip in seconds. A shorter clip would show no frame of its take."""
_MIN_CLIP_SPEED = 0.02
"""Minimum playback speed of a clip, relative to the recording: one fiftieth."""
_MAX_CLIP_SPEED = 50.0
"""Maximum playback speed of a clip, relative to the recording."""
_Lane = Callable[[tuple[Segment, ...]], Sequence[Segment]]


def find_layer_clips(project: Project, character_id: str, number: int) -> tuple[Segment, ...]:
    """Returns the clips of a layer, in seconds of the project.

    Raises:
        InputError: if the character or layer does not exist.
    """
    layer = _find_layer(project.character(character_id), number)
    return layer.clips(project.length_of(layer))


def split_clip(project: Project, character_id: str, numbers: Iterable[int], time: float) -> Project:
    """Splits the clip at a time in two. The motion stays the same.

    Raises:
        InputError: if no clip plays at that time, the time is at the start or end of a clip, or two clips are
            blended there.
    """

    numbers = tuple(numbers)
    project_time, time = (
        time,
        _find_layer(project.character(character_id), numbers[0]).convert_to_unwarped_time(time),
    )

    def change(clips: tuple[Segment, ...]) -> Sequence[Segment]:
        clips_there = [
            k for k, clip in enumerate(clips) if clip.begin + _MIN_CLIP_S < time < clip.end - _MIN_CLIP_S
        ]
        if not clips_there:
            problem, remedy = (
                f"no clip can be split at {project_time:.2f} s",
                "Move the playhead into a clip, away from the clip's ends.",
            )
            raise InputError(problem, where=f"character {character_id!r}", remedy=remedy)
        number = clips_there[-1]
        clip = clips[number]
        if number and time < clips[number - 1].end:
            raise InputError(
                "two clips overlap in a blend at this time",
                where=f"character {character_id!r}",
                remedy="Split one of the clips outside of the blend.",
            )
        parts = (replace(clip, end=time), replace(clip, begin=time, first=clip.compute_take_time(time)))
        return (*clips[:number], *parts, *clips[number + 1 :])

    return _with_clips(project, character_id, numbers, change)


def trim_clip(
    project: Project,
    character_id: str,
    numbers: Iterable[int],
    clip: int,
    *,
    begin: float | None = None,
    end: float | None = None,
) -> Project:
    """Changes the start or end time of a clip. The remaining part of the clip plays as before.

    The clip cannot extend beyond its take's first or last frame.
    """
    character, numbers = project.character(character_id), tuple(numbers)
    layer = _find_layer(character, numbers[0])
    length = project.length_of(layer)
    begin, end = (None if time is None else layer.convert_to_unwarped_time(time) for time in (begin, end))

    def change(segment: Segment) -> Segment:
        ends = sorted(
            (
                segment.begin - segment.first / segment.speed,
                segment.begin + (length - segment.first) / segment.speed,
            )
        )
        # A clip cannot be extended beyond its take. A clip that already extends beyond its take may keep that
        # length. It repeats the first or last frame there.
        low, high = min(ends[0], segment.begin), max(ends[1], segment.end)
        start = segment.begin if begin is None else min(max(begin, low), segment.end - _MIN_CLIP_S)
        stop = segment.end if end is None else max(min(end, high), start + _MIN_CLIP_S)
        return replace(segment, begin=start, end=stop, first=segment.compute_take_time(start))

    return _with_changed_clip(project, character_id, numbers, clip, change)


def slip_clip(
    project: Project, character_id: str, numbers: Iterable[int], clip: int, seconds: float
) -> Project:
    """Slips a clip (slip edit): its start and end stay the same, but it plays a part of its take that is
    ``seconds`` later."""
    return _with_changed_clip(
        project, character_id, numbers, clip, lambda one: replace(one, first=one.first + seconds)
    )


def move_clip(
    project: Project, character_id: str, numbers: Iterable[int], clip: int, delay: float
) -> Project:
    """Delays a clip by ``delay`` seconds. If it overlaps another clip, the two are blended.

    Raises:
        InputError: if the clip would be inside another clip, or three clips would overlap.
    """
    numbers = tuple(numbers)
    layer = _find_layer(project.character(character_id), numbers[0])

    def change(segment: Segment) -> Segment:
        start_delay = (
            layer.convert_to_unwarped_time(layer.convert_to_warped_time(segment.begin) + delay)
            - segment.begin
        )
        return replace(segment, begin=segment.begin + start_delay, end=segment.end + start_delay)

    return _with_changed_clip(project, character_id, numbers, clip, change)


def stretch_clip(
    project: Project,
    character_id: str,
    numbers: Iterable[int],
    clip: int,
    *,
    begin: float | None = None,
    end: float | None = None,
) -> Project:
    """Plays the same part of a clip's take faster or slower, so that it lasts from ``begin`` to ``end``."""
    numbers = tuple(numbers)
    layer = _find_layer(project.character(character_id), numbers[0])
    begin, end = (None if time is None else layer.convert_to_unwarped_time(time) for time in (begin, end))

    def change(segment: Segment) -> Segment:
        start, stop = segment.begin if begin is None else begin, segment.end if end is None else end
        lasts = segment.end - segment.begin
        factor = lasts / max(stop - start, 1e-9)
        speed = min(max(abs(segment.speed) * factor, _MIN_CLIP_SPEED), _MAX_CLIP_SPEED)
        lasts *= abs(segment.speed) / speed
        # The end that is not dragged stays in place.
        start, stop = (stop - lasts, stop) if end is None else (start, start + lasts)
        return Segment(start, stop, segment.first, speed if segment.speed > 0.0 else -speed)

    return _with_changed_clip(project, character_id, numbers, clip, change)


def reverse_clip(project: Project, character_id: str, numbers: Iterable[int], clip: int) -> Project:
    """Makes a clip play backwards. Its start and end time stay the same."""
    return _with_changed_clip(
        project, character_id, numbers, clip, lambda one: replace(one, first=one.last, speed=-one.speed)
    )


def remove_clip(project: Project, character_id: str, numbers: Iterable[int], clip: int) -> Project:
    """Removes a clip from a lane.

    Raises:
        InputError: if the clip is the only clip of the lane, or does not exist.
    """

    def change(clips: tuple[Segment, ...]) -> Sequence[Segment]:
        _check_clip(clips, clip, character_id)
        return (*clips[:clip], *clips[clip + 1 :])

    return _with_clips(project, character_id, numbers, change)


def blend_clips(
    project: Project, character_id: str, numbers: Iterable[int], clip: int, seconds: float
) -> Project:
    """Blends a clip into the next clip by a cross-fade. The fade takes ``seconds``, half of them on each side
    of the boundary.

    If a take has no more frames there, its last pose is repeated. With 0 seconds, an existing overlap is
    removed, and the clips meet in its middle.

    Raises:
        InputError: if the clip is the last one, or if the next clip does not begin at the end of the clip.
    """

    def change(clips: tuple[Segment, ...]) -> Sequence[Segment]:
        _check_clip(clips, clip, character_id)
        if clip + 1 >= len(clips) or clips[clip + 1].begin > clips[clip].end + _MIN_CLIP_S:
            remedy = "Move the next clip to the end of this clip, and then blend them."
            raise InputError(
                "no clip begins at the end of this clip", where=f"character {character_id!r}", remedy=remedy
            )
        first, after = clips[clip], clips[clip + 1]
        middle = (first.end + after.begin) / 2.0
        half = min(
            max(seconds, 0.0) / 2.0, middle - first.begin - _MIN_CLIP_S, after.end - middle - _MIN_CLIP_S
        )
        start = middle - half
        blended = (
            replace(first, end=middle + half),
            replace(after, begin=start, first=after.compute_take_time(start)),
        )
        return (*clips[:clip], *blended, *clips[clip + 2 :])

    return _with_clips(project, character_id, numbers, change)


def mirror_layers(project: Project, character_id: str, numbers: Iterable[int]) -> Project:
    """Toggles whether layers play the mirror image of their take (left and right swapped).

    Raises:
        InputError: if the character is a possessed mesh. Its recording contains poses of the mesh's own
            nodes, which cannot be mirrored.
    """
    character, numbers = project.character(character_id), tuple(numbers)
    layer = _find_layer(character, numbers[0])
    if layer.source != "takes":
        problem = "the recorded motion of a possessed mesh cannot be mirrored separately"
        raise InputError(problem, where=character.where, remedy="Mirror the whole character.")
    return change_layers(project, character_id, numbers, mirrored=not layer.mirrored)  # type: ignore[attr-defined]


def _with_changed_clip(
    project: Project,
    character_id: str,
    numbers: Iterable[int],
    clip: int,
    change: Callable[[Segment], Segment],
) -> Project:
    """Returns the project with ``change`` applied to one clip of some layers. The other clips stay
    unchanged."""

    def lane(clips: tuple[Segment, ...]) -> Sequence[Segment]:
        _check_clip(clips, clip, character_id)
        return (*clips[:clip], change(clips[clip]), *clips[clip + 1 :])

    return _with_clips(project, character_id, numbers, lane)


def _with_clips(project: Project, character_id: str, numbers: Iterable[int], change: _Lane) -> Project:
    """Applies ``change`` to the clips of the first of the layers ``numbers``, and gives the resulting clips
    to all of these layers."""
    character, layer_numbers = project.character(character_id), tuple(numbers)
    first = _find_layer(character, layer_numbers[0])
    length = project.length_of(first)
    edited = first.with_lane(lambda lane: lane.with_clips(change(lane.clips(length)), length))
    names = ("offset", "speed", "segments", "weights", "speeds")
    project = change_layers(
        project, character_id, layer_numbers, **{name: getattr(edited, name) for name in names}
    )
    # `ease` is in seconds of the lane, which depend on the lane's speed. Fades keep their duration in the
    # project.
    for number in layer_numbers:
        layer = _find_layer(character, number)
        if layer.ease > 0.0 and abs(layer.speed) != abs(edited.speed):
            ease = layer.ease * abs(edited.speed / layer.speed)
            project = change_layers(project, character_id, [number], ease=ease)
    return project


def _find_layer(character: RigBase, number: int) -> LayerBase:
    playing = character.playing
    if not 0 <= number < len(playing):
        remedy = f"The layers are numbered from 0. Number of layers: {len(playing)}."
        raise InputError(f"the character has no layer {number}", where=character.where, remedy=remedy)
    return playing[number]


def _check_clip(clips: Sequence[Segment], clip: int, character_id: str) -> None:
    """Raises an error if the clip does not exist."""
    if not 0 <= clip < len(clips):
        problem, remedy = (
            f"the lane has no clip {clip}",
            f"The clips are numbered from 0. Number of clips: {len(clips)}.",
        )
        raise InputError(problem, where=f"character {character_id!r}", remedy=remedy)
