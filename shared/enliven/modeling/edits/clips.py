"""Edits of the clips of a lane: one implementation for the layers of all rigs.

    split_clip(project, "squid", [0], time)                   # nothing looks different
    trim_clip(project, "squid", [0], 1, begin=2.0)            # what is left plays as before
    slip_clip(project, "squid", [0], 1, 0.5)                  # another part of the take, at the same time
    blend_clips(project, "squid", [0], 0, 0.4)                # one clip goes over into the next

A lane is what a character's layers play that share a bar on the timeline; its clips are numbered in the order
of time, in seconds of the project. An edit that is refused raises InputError and changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from enliven.document import Playing, Project, RigBase, Segment
from enliven.errors import InputError
from enliven.modeling.edits.characters import change_layers

_SHORTEST = 1e-3
"""Seconds of a clip at least: below it no frame of a take is seen."""
_SLOWEST = 0.02
"""Times as recorded that a clip is played at least: a fiftieth."""
_FASTEST = 50.0
"""Times as recorded that a clip is played at most."""
_Lane = Callable[[tuple[Segment, ...]], Sequence[Segment]]


def clips_of(project: Project, character_id: str, number: int) -> tuple[Segment, ...]:
    """The clips of a layer, in seconds of the project.

    Raises:
        InputError: where there is no such character or layer.
    """
    layer = _layer(project.character(character_id), number)
    return layer.clips(project.length_of(layer))


def split_clip(project: Project, character_id: str, numbers: Iterable[int], time: float) -> Project:
    """A project in which the clip under a time is two; it plays as before.

    Raises:
        InputError: where no clip is there, or its end is.
    """

    numbers = tuple(numbers)
    seen, time = time, _layer(project.character(character_id), numbers[0]).even(time)

    def change(clips: tuple[Segment, ...]) -> Sequence[Segment]:
        inside = [k for k, one in enumerate(clips) if one.begin + _SHORTEST < time < one.end - _SHORTEST]
        if not inside:
            what, mend = (
                f"no clip is there at {seen:.2f} s",
                "Put the playhead over a clip, away from its ends.",
            )
            raise InputError(what, where=f"character {character_id!r}", mend=mend)
        number = inside[-1]
        one = clips[number]
        if number and time < clips[number - 1].end:
            raise InputError(
                "two clips are blended there",
                where=f"character {character_id!r}",
                mend="Split beside the blend.",
            )
        parts = (replace(one, end=time), replace(one, begin=time, first=one.second(time)))
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
    """A project with a clip that begins or ends at another time; what is left of it plays as before.

    It gets no longer than its take: from the first frame, or to the last.
    """
    character, numbers = project.character(character_id), tuple(numbers)
    layer = _layer(character, numbers[0])
    length = project.length_of(layer)
    begin, end = (None if at is None else layer.even(at) for at in (begin, end))

    def change(one: Segment) -> Segment:
        ends = sorted((one.begin - one.first / one.speed, one.begin + (length - one.first) / one.speed))
        # A clip that holds an end of its take already may keep doing so.
        low, high = min(ends[0], one.begin), max(ends[1], one.end)
        start = one.begin if begin is None else min(max(begin, low), one.end - _SHORTEST)
        stop = one.end if end is None else max(min(end, high), start + _SHORTEST)
        return replace(one, begin=start, end=stop, first=one.second(start))

    return _changed(project, character_id, numbers, clip, change)


def slip_clip(
    project: Project, character_id: str, numbers: Iterable[int], clip: int, seconds: float
) -> Project:
    """A project with a clip that plays what comes ``seconds`` of its take later, at the same time."""
    return _changed(project, character_id, numbers, clip, lambda one: replace(one, first=one.first + seconds))


def move_clip(
    project: Project, character_id: str, numbers: Iterable[int], clip: int, delay: float
) -> Project:
    """A project with a clip that plays ``delay`` seconds later; where it overlaps another they are blended.

    Raises:
        InputError: where it would lie within another, or three would overlap.
    """
    numbers = tuple(numbers)
    layer = _layer(project.character(character_id), numbers[0])

    def change(one: Segment) -> Segment:
        late = layer.even(layer.uneven(one.begin) + delay) - one.begin
        return replace(one, begin=one.begin + late, end=one.end + late)

    return _changed(project, character_id, numbers, clip, change)


def stretch_clip(
    project: Project,
    character_id: str,
    numbers: Iterable[int],
    clip: int,
    *,
    begin: float | None = None,
    end: float | None = None,
) -> Project:
    """A project in which a clip plays the same of its take faster or slower, from ``begin`` to ``end``."""
    numbers = tuple(numbers)
    layer = _layer(project.character(character_id), numbers[0])
    begin, end = (None if at is None else layer.even(at) for at in (begin, end))

    def change(one: Segment) -> Segment:
        start, stop = one.begin if begin is None else begin, one.end if end is None else end
        lasts = one.end - one.begin
        factor = lasts / max(stop - start, 1e-9)
        speed = min(max(abs(one.speed) * factor, _SLOWEST), _FASTEST)
        lasts *= abs(one.speed) / speed
        # The end that is not dragged stays.
        start, stop = (stop - lasts, stop) if end is None else (start, start + lasts)
        return Segment(start, stop, one.first, speed if one.speed > 0.0 else -speed)

    return _changed(project, character_id, numbers, clip, change)


def reverse_clip(project: Project, character_id: str, numbers: Iterable[int], clip: int) -> Project:
    """A project with a clip that plays backwards, where it is."""
    return _changed(
        project, character_id, numbers, clip, lambda one: replace(one, first=one.last, speed=-one.speed)
    )


def remove_clip(project: Project, character_id: str, numbers: Iterable[int], clip: int) -> Project:
    """A project without a clip of a lane.

    Raises:
        InputError: for the only one of a lane, or one that is not there.
    """

    def change(clips: tuple[Segment, ...]) -> Sequence[Segment]:
        _number(clips, clip, character_id)
        return (*clips[:clip], *clips[clip + 1 :])

    return _with_clips(project, character_id, numbers, change)


def blend_clips(
    project: Project, character_id: str, numbers: Iterable[int], clip: int, seconds: float
) -> Project:
    """A project in which a clip goes over into the next within ``seconds``, half of them on either side.

    Where their takes have no more frames there, an end stands still. With 0 they meet in the middle of where
    they overlapped.

    Raises:
        InputError: for the last clip, or where the next does not begin where it ends.
    """

    def change(clips: tuple[Segment, ...]) -> Sequence[Segment]:
        _number(clips, clip, character_id)
        if clip + 1 >= len(clips) or clips[clip + 1].begin > clips[clip].end + _SHORTEST:
            mend = "Move the next clip up to it first."
            raise InputError("no clip follows it there", where=f"character {character_id!r}", mend=mend)
        one, other = clips[clip], clips[clip + 1]
        middle = (one.end + other.begin) / 2.0
        half = min(max(seconds, 0.0) / 2.0, middle - one.begin - _SHORTEST, other.end - middle - _SHORTEST)
        start = middle - half
        made = (
            replace(one, end=middle + half),
            replace(other, begin=start, first=other.second(start)),
        )
        return (*clips[:clip], *made, *clips[clip + 2 :])

    return _with_clips(project, character_id, numbers, change)


def mirror_layers(project: Project, character_id: str, numbers: Iterable[int]) -> Project:
    """A project in which layers play the mirror image of their take, left for right, or no longer do.

    Raises:
        InputError: for a possessed mesh, which plays where its own nodes went.
    """
    character, numbers = project.character(character_id), tuple(numbers)
    layer = _layer(character, numbers[0])
    if layer.source != "takes":
        what = "what was recorded of a mesh fits that mesh alone"
        raise InputError(what, where=character.where, mend="Mirror the whole character.")
    return change_layers(project, character_id, numbers, mirrored=not layer.mirrored)  # type: ignore[attr-defined]


def _changed(
    project: Project,
    character_id: str,
    numbers: Iterable[int],
    clip: int,
    change: Callable[[Segment], Segment],
) -> Project:
    """A project with one clip changed; the others stay."""

    def lane(clips: tuple[Segment, ...]) -> Sequence[Segment]:
        _number(clips, clip, character_id)
        return (*clips[:clip], change(clips[clip]), *clips[clip + 1 :])

    return _with_clips(project, character_id, numbers, lane)


def _with_clips(project: Project, character_id: str, numbers: Iterable[int], change: _Lane) -> Project:
    """A project with the lane of some layers changed, which they all have then."""
    character, wanted = project.character(character_id), tuple(numbers)
    first = _layer(character, wanted[0])
    length = project.length_of(first)
    made = first.with_lane(lambda lane: lane.with_clips(change(lane.clips(length)), length))
    names = ("offset", "speed", "segments", "weights", "speeds")
    return change_layers(project, character_id, wanted, **{name: getattr(made, name) for name in names})


def _layer(character: RigBase, number: int) -> Playing:
    playing = character.playing
    if not 0 <= number < len(playing):
        mend = f"It has {len(playing)}."
        raise InputError(f"there is no layer {number}", where=character.where, mend=mend)
    return playing[number]


def _number(clips: Sequence[Segment], clip: int, character_id: str) -> None:
    """Refuse the number of a clip that is not there."""
    if not 0 <= clip < len(clips):
        what, mend = f"there is no clip {clip}", f"That lane has {len(clips)}."
        raise InputError(what, where=f"character {character_id!r}", mend=mend)
