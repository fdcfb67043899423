"""The layout of the timeline: ruler, lanes by character, clips, and the handle under the pointer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Protocol

from enliven.document import Marker, Playing, Project, RigBase, Segment
from enliven_viewer.language import tr
from enliven_viewer.studio.timeline.lane_names import lane_name

LABELS = 190.0
"""Pixels, width of the labels: about 25 letters."""
RULER = 26.0
"""Pixels, height of the ruler."""
LANE = 28.0
"""Pixels, height of a lane: small figures and a line of text over them."""
HEAD = 20.0
"""Pixels, height of the row with a character's name over its lanes."""
GAP = 3.0
"""Pixels between two lanes."""
END = 12.0
"""Pixels that are left free at the right, so that the last bar's end can be taken."""
EDGE = 7.0
"""Pixels around a clip's end that trim it, or change its speed with Ctrl."""
MUTE = 22.0
"""Pixels of an icon at the left of a label: the eye that mutes, the lock after it, what folds a character."""
SOLO = 20.0
"""Pixels at the right of a character's label that let it play alone."""
TAKES = 34.0
"""Pixels at the right of a label in which stands which of its takes is heard; a click opens them."""
SPAN = 8.0
"""Pixels, height of the band on the ruler that shows where recordings begin and end."""
MARK = 6.0
"""Pixels around a marker on the ruler that take hold of it."""
_FEW = 12
"""Layers of a take that have a lane each; a model with more has a layer a bone, and they share lanes."""
_STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 300.0)
"""Seconds between two numbers of the ruler: round ones."""


@dataclass(frozen=True)
class LaneHandle:
    """The part of the timeline under the pointer.

    Attributes:
        kind: "ruler", "marker", "from", "to" and "marked" (the marked span's ends, and it); of a lane "bar",
            "begin" and "edge" (a clip and its ends), "blend", "mute", "lock", "takes" (opens its
            alternatives), "label"; of a character "fold", "solo", "name"; "nothing"; or of a row of details.
        character, layers: of what it is a part.
        item: which of the clips, or of those in a row of details.
        seconds: of the layer's take, at the pixel.
        name: of a marker.
    """

    kind: str
    character: str = ""
    layers: tuple[int, ...] = ()
    item: int = 0
    seconds: float = 0.0
    name: str = ""

    @property
    def number(self) -> int:
        """Returns the first of the layers."""
        return self.layers[0]


@dataclass(frozen=True)
class Lane:
    """A row: a bar, details of a layer, or a character's name; and the first and last pixel of its clips.

    Layers of a character that play one take in the same way share a bar: a model that comes with its own
    animation has a layer for every bone.

    Attributes:
        clips: of a bar, in seconds of the project.
    """

    kind: str
    character: RigBase
    layers: tuple[int, ...]
    top: float
    height: float
    left: float
    right: float
    clips: tuple[Segment, ...] = ()

    @property
    def layer(self) -> Playing:
        """Returns the first of its layers."""
        return self.character.playing[self.layers[0]]

    @property
    def label(self) -> str:
        """Returns the limb that moves and what it plays, or the take and how many layers play it."""
        if len(self.layers) > 1:
            return tr("{0}  ({1} bones)", self.layer.take, len(self.layers))
        return lane_name(self.character, self.layer)


class Details(Protocol):
    """What a rig shows under the bars of its layers."""

    def rows(self, character: RigBase, number: int) -> Sequence[tuple[str, float]]:
        """Returns the kinds and heights in pixels of the rows under a layer's bar."""

    def at(self, layout: TimelineLayout, lane: Lane, x: float) -> tuple[str, int]:
        """What is at a pixel of such a row, and which; "nothing" where nothing is."""


@dataclass(frozen=True)
class TimelineLayout:
    """The timeline of a project in an area with its top left at 0, 0.

    Attributes:
        project: its layers are shown.
        length: seconds of the whole project.
        width: pixels of the whole area.
        scrolled: pixels by which the lanes are moved up.
        details: what rigs show under their bars.
        start: the second at the track's left.
        span: seconds that the track shows; 0: all.
        folded: the characters with one row for all of their lanes.
        opened: the alternatives of which every take has a lane; of others the one that is heard has.
        marked: the seconds in which recordings begin and end, or None.
    """

    project: Project
    length: float
    width: float
    scrolled: float = 0.0
    details: Details | None = None
    start: float = 0.0
    span: float = 0.0
    folded: frozenset[str] = frozenset()
    opened: frozenset[str] = frozenset()
    marked: tuple[float, float] | None = None

    @property
    def track(self) -> float:
        """Returns pixels of the track's width."""
        return max(self.width - LABELS - END, 1.0)

    @property
    def shown(self) -> float:
        """Returns seconds that the track shows."""
        return self.span or self.length

    @property
    def height(self) -> float:
        """Returns pixels that ruler and lanes take."""
        lanes = self.lanes()
        return lanes[-1].top + lanes[-1].height + GAP + self.scrolled if lanes else RULER

    def x(self, time: float) -> float:
        """Returns the pixel of a time."""
        return LABELS + self.track * (time - self.start) / self.shown

    def time(self, x: float) -> float:
        """Returns the time of a pixel, seconds; outside the track it goes on."""
        return self.start + (x - LABELS) / self.track * self.shown

    def x_of(self, lane: Lane, second: float) -> float:
        """Returns the pixel of a second of a lane's take."""
        return self.x(lane.layer.time_of(second, self.project.length_of(lane.layer)))

    def second(self, lane: Lane, x: float) -> float:
        """Returns the second of a lane's take at a pixel, within the take."""
        once = replace(lane.layer, loop=False)
        return once.played(self.time(x), self.project.length_of(once))[0]

    def lanes(self) -> tuple[Lane, ...]:
        """Returns all rows, from the top: of each layer a bar, and under it what its rig shows."""
        return self._lanes

    @cached_property
    def _lanes(self) -> tuple[Lane, ...]:
        top, found, shared = RULER - self.scrolled, list[Lane](), self._shared()
        named, before = len({name for name, _ in shared}) > 1, ""
        for name, numbers in shared:
            character = self.project.characters[name]
            layer = character.playing[numbers[0]]
            if named and name != before:
                every = tuple(number for other, some in shared if other == name for number in some)
                found.append(Lane("head", character, every, top, HEAD, LABELS, LABELS))
                top, before = top + HEAD + 1.0, name
            if named and name in self.folded:
                continue
            clips = layer.clips(self.project.length_of(layer))
            span = self.x(clips[0].begin), self.x(clips[-1].end)
            rows = self.details.rows(character, numbers[0]) if self.details is not None else ()
            for kind, height in (("bar", LANE), *rows):
                found.append(Lane(kind, character, numbers, top, height, *span, clips))
                top += height + 1.0
            top += GAP - 1.0
        return tuple(found)

    def bars(self) -> tuple[Lane, ...]:
        """Returns the lanes that are bars, from the top."""
        return tuple(lane for lane in self.lanes() if lane.kind == "bar")

    def markers(self) -> tuple[tuple[Marker, float], ...]:
        """Returns every marker with its pixel, in the order of time."""
        ordered = sorted(self.project.markers.values(), key=lambda one: one.seconds)
        return tuple((one, self.x(one.seconds)) for one in ordered)

    def _shared(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Returns the character and the numbers of its layers that share a bar, from the top."""
        groups: dict[tuple[object, ...], list[int]] = {}
        for key, character in self.project.characters.items():
            playing = character.playing
            hidden = self._unheard(playing)
            for number, layer in enumerate(playing):
                if number in hidden:
                    continue
                few = sum(other.take == layer.take for other in playing) <= _FEW
                alone = number if few and layer.source == "takes" else -1
                how = (layer.take, layer.muted, layer.when())
                groups.setdefault((key, *how, alone), []).append(number)
        return tuple((str(group[0]), tuple(numbers)) for group, numbers in groups.items())

    def takes(self, lane: Lane) -> tuple[int, int]:
        """Returns which of its alternatives a lane is, from 1, and how many there are on its character."""
        layer = lane.layer
        beside = [one for one in lane.character.playing if one.alternatives == layer.alternatives]
        names = list(dict.fromkeys(one.recorded for one in beside))
        return names.index(layer.recorded) + 1, len(names) if layer.alternatives else 1

    def _unheard(self, playing: Sequence[Playing]) -> set[int]:
        """Returns the layers that have no lane: takes that are not heard, where their alternatives are not
        opened.
        """
        beside: dict[str, dict[str, list[int]]] = {}
        for number, layer in enumerate(playing):
            if layer.alternatives and layer.alternatives not in self.opened:
                beside.setdefault(layer.alternatives, {}).setdefault(layer.recorded, []).append(number)
        hidden = set[int]()
        for takes in beside.values():
            heard = [name for name, some in takes.items() if not all(playing[k].muted for k in some)]
            shown = heard[-1] if heard else list(takes)[-1]
            hidden.update(k for name, some in takes.items() if name != shown for k in some)
        return hidden

    def ticks(self) -> tuple[tuple[float, bool], ...]:
        """Times to mark on the ruler, and whether each is numbered; numbers stand 60 pixels apart or more."""
        wanted = 60.0 * self.shown / self.track
        step = next((s for s in _STEPS if s >= wanted), _STEPS[-1])
        small = step / 5
        first, last = -int(-self.start / small), int((self.start + self.shown) / small + 1e-9)
        return tuple((k * small, k % 5 == 0) for k in range(first, last + 1))

    def handle_at(self, x: float, y: float) -> LaneHandle:
        """Returns the handle under a pixel."""
        if y < RULER:
            return self._on_ruler(x, y)
        for lane in self.lanes():
            if lane.top <= y < lane.top + lane.height:
                kind, item = self._at(lane, x)
                if kind != "nothing":
                    second = 0.0 if lane.kind in ("bar", "head") else self.second(lane, x)
                    return LaneHandle(kind, lane.character.id, lane.layers, item, second)
        return LaneHandle("ruler") if x >= LABELS - END else LaneHandle("nothing")

    def _on_ruler(self, x: float, y: float) -> LaneHandle:
        near = [(abs(at - x), one.id) for one, at in self.markers() if abs(at - x) <= MARK]
        if near:
            return LaneHandle("marker", name=min(near)[1])
        if self.marked is not None:
            low, high = (self.x(end) for end in self.marked)
            away, kind = min((abs(high - x), "to"), (abs(low - x), "from"))
            if away <= EDGE:
                return LaneHandle(kind)
            if low < x < high and y >= RULER - SPAN:
                return LaneHandle("marked")
        return LaneHandle("ruler") if x >= LABELS - END else LaneHandle("nothing")

    def _at(self, lane: Lane, x: float) -> tuple[str, int]:
        """What is at a pixel of a lane."""
        if lane.kind == "head":
            if x >= LABELS - END:
                return "nothing", 0
            return ("fold" if x < MUTE else "solo" if x >= LABELS - END - SOLO else "name"), 0
        if lane.kind != "bar" and self.details is not None:
            return self.details.at(self, lane, x)
        if x < LABELS - END:
            if x >= LABELS - END - TAKES and self.takes(lane)[1] > 1:
                return "takes", 0
            return ("mute" if x < MUTE else "lock" if x < 2 * MUTE else "label"), 0
        return self._on_clips(lane, x)

    def _on_clips(self, lane: Lane, x: float) -> tuple[str, int]:
        """Returns the clip, or the end of one, at a pixel of a bar; of a narrow one its end and the
        middle.
        """
        ends = [(self.x(one.begin), self.x(one.end)) for one in lane.clips]
        for k, ((_, right), (left, _)) in enumerate(pairwise(ends)):
            if right - left > 2 * EDGE and left + EDGE < x < right - EDGE:
                return "blend", k
        near = [(abs(right - x), 0, k) for k, (_, right) in enumerate(ends)]
        near += [(abs(left - x), 1, k) for k, (left, right) in enumerate(ends) if right - left > 3 * EDGE]
        away, which, number = min(near)
        if away <= EDGE:
            # Where two clips meet, the side of the pointer decides which of them is trimmed.
            return ("begin" if which else "edge"), number
        inside = [k for k, (left, right) in enumerate(ends) if left <= x <= right]
        if not inside and lane.layer.loop and x >= lane.left:
            inside = [len(ends) - 1]
        return ("bar", inside[-1]) if inside else ("nothing", 0)
