"""The layout of the timeline: ruler, lanes grouped by character, clips, and hit testing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Protocol

from enliven.document import LayerBase, Marker, Project, RigBase, Segment
from enliven_viewer.language import tr
from enliven_viewer.studio.timeline.lane_names import make_lane_name

LABEL_WIDTH = 190.0
"""Width of the labels in pixels: about 25 letters."""
RULER_HEIGHT = 26.0
"""Height of the ruler in pixels."""
LANE_HEIGHT = 28.0
"""Height of a lane in pixels: thumbnails with a line of text over them."""
HEAD_HEIGHT = 20.0
"""Height, in pixels, of the row with a character's name above its lanes."""
LANE_GAP = 3.0
"""Gap between two lanes in pixels."""
END_MARGIN = 12.0
"""Margin at the right in pixels, so that the end of the last bar can be grabbed."""
EDGE_GRAB_DISTANCE = 7.0
"""Distance in pixels from a clip's end within which a drag trims it, or changes its speed with Ctrl."""
MUTE_ICON_WIDTH = 22.0
"""Width in pixels of an icon at the left of a label: mute (eye), lock, or fold."""
SOLO_BUTTON_WIDTH = 20.0
"""Width in pixels of the solo button at the right of a character's label."""
TAKES_BUTTON_WIDTH = 34.0
"""Width in pixels of the take number at the right of a label; a click opens the alternatives."""
SPAN_BAND_HEIGHT = 8.0
"""Height in pixels of the band on the ruler that shows the recording range."""
MARKER_GRAB_DISTANCE = 6.0
"""Distance in pixels from a marker on the ruler within which it can be grabbed."""
_MAX_TAKE_LANES = 12
"""Maximum number of layers of one take that get a lane each. Models with one layer per bone have more, and
these share lanes.
"""
_TICK_INTERVALS_S = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 300.0)
"""Time intervals between two numbers on the ruler, in seconds."""


@dataclass(frozen=True)
class LaneHandle:
    """The part of the timeline under the pointer.

    Attributes:
        kind: "ruler"; "marker"; "from", "to" and "marked" for the ends and the middle of the marked span. On
            a lane: "bar", "begin" and "edge" for a clip and its ends, "blend", "mute", "lock", "takes" (opens
            its alternatives) and "label". On a character's row: "fold", "solo" and "name". Otherwise
            "nothing", or a kind of the details row.
        character, layers: the character and the layers that the part belongs to.
        item: number of the clip, or of the mark in a details row.
        seconds: time in the layer's take at the pixel.
        name: name of the marker.
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
    """A row of the timeline: a bar, details of a layer, or a character's name.

    Its left and right are the first and last pixel of its clips. Layers of a character that play one take in
    the same way share a bar, because an imported animation has a layer for every bone.

    Attributes:
        clips: the clips of a bar, in seconds of the project.
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
    def layer(self) -> LayerBase:
        """Returns the first of its layers."""
        return self.character.playing[self.layers[0]]

    @property
    def label(self) -> str:
        """Returns the limb that moves and its take, or the take and the number of layers that play it."""
        if len(self.layers) > 1:
            return tr("{0}  ({1} bones)", self.layer.take, len(self.layers))
        return make_lane_name(self.character, self.layer)


class Details(Protocol):
    """Provides the rows below the bars of a rig's layers."""

    def rows(self, character: RigBase, number: int) -> Sequence[tuple[str, float]]:
        """Returns the kinds and heights in pixels of the rows below a layer's bar."""

    def at(self, layout: TimelineLayout, lane: Lane, x: float) -> tuple[str, int]:
        """Returns the kind and number of the mark at a pixel of such a row; "nothing" if there is none."""


@dataclass(frozen=True)
class TimelineLayout:
    """The layout of a project's timeline in an area with its top left corner at 0, 0.

    Attributes:
        project: the project with the shown layers.
        length: length of the whole project in seconds.
        width: width of the whole area in pixels.
        scrolled: vertical scroll offset of the lanes in pixels.
        details: the rows that rigs show below their bars.
        start: time at the left of the track, in seconds.
        span: visible time span in seconds; 0 shows everything.
        folded: the characters with all lanes collapsed into one row.
        opened: groups of alternatives that show a lane for every take. Other groups show only the audible
            take.
        marked: start and end of recordings in seconds, or None.
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
        """Returns the width of the track in pixels."""
        return max(self.width - LABEL_WIDTH - END_MARGIN, 1.0)

    @property
    def visible_s(self) -> float:
        """Returns the visible time span in seconds."""
        return self.span or self.length

    @property
    def height(self) -> float:
        """Returns the total height of ruler and lanes in pixels."""
        lanes = self.lanes()
        return lanes[-1].top + lanes[-1].height + LANE_GAP + self.scrolled if lanes else RULER_HEIGHT

    def x(self, time: float) -> float:
        """Returns the x coordinate of a time, in pixels."""
        return LABEL_WIDTH + self.track * (time - self.start) / self.visible_s

    def time(self, x: float) -> float:
        """Returns the time of an x coordinate, in seconds; extrapolates outside the track."""
        return self.start + (x - LABEL_WIDTH) / self.track * self.visible_s

    def x_of(self, lane: Lane, second: float) -> float:
        """Returns the x coordinate of a time in a lane's take."""
        return self.x(lane.layer.time_of(second, self.project.length_of(lane.layer)))

    def second(self, lane: Lane, x: float) -> float:
        """Returns the time in a lane's take at an x coordinate, clamped to the take."""
        once = replace(lane.layer, loop=False)
        return once.played(self.time(x), self.project.length_of(once))[0]

    def lanes(self) -> tuple[Lane, ...]:
        """Returns all rows from the top: a bar for each layer, and the details of its rig below it."""
        return self._lanes

    @cached_property
    def _lanes(self) -> tuple[Lane, ...]:
        top, lanes, shared = RULER_HEIGHT - self.scrolled, list[Lane](), self._group_layers()
        named, before = len({name for name, _ in shared}) > 1, ""
        for name, numbers in shared:
            character = self.project.characters[name]
            layer = character.playing[numbers[0]]
            if named and name != before:
                every = tuple(number for other, some in shared if other == name for number in some)
                lanes.append(Lane("head", character, every, top, HEAD_HEIGHT, LABEL_WIDTH, LABEL_WIDTH))
                top, before = top + HEAD_HEIGHT + 1.0, name
            if named and name in self.folded:
                continue
            clips = layer.clips(self.project.length_of(layer))
            span = self.x(clips[0].begin), self.x(clips[-1].end)
            rows = self.details.rows(character, numbers[0]) if self.details is not None else ()
            for kind, height in (("bar", LANE_HEIGHT), *rows):
                lanes.append(Lane(kind, character, numbers, top, height, *span, clips))
                top += height + 1.0
            top += LANE_GAP - 1.0
        return tuple(lanes)

    def bars(self) -> tuple[Lane, ...]:
        """Returns the lanes that are bars, from the top."""
        return tuple(lane for lane in self.lanes() if lane.kind == "bar")

    def markers(self) -> tuple[tuple[Marker, float], ...]:
        """Returns every marker with its x coordinate, in order of time."""
        ordered = sorted(self.project.markers.values(), key=lambda marker: marker.seconds)
        return tuple((marker, self.x(marker.seconds)) for marker in ordered)

    def _group_layers(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Returns each character with the numbers of the layers that share a bar, from the top."""
        groups: dict[tuple[object, ...], list[int]] = {}
        for key, character in self.project.characters.items():
            playing = character.playing
            hidden = self._find_hidden_layers(playing)
            for number, layer in enumerate(playing):
                if number in hidden:
                    continue
                few = sum(other.take == layer.take for other in playing) <= _MAX_TAKE_LANES
                alone = number if few and layer.source == "takes" else -1
                group_key = (layer.take, layer.muted, layer.when())
                groups.setdefault((key, *group_key, alone), []).append(number)
        return tuple((str(group[0]), tuple(numbers)) for group, numbers in groups.items())

    def takes(self, lane: Lane) -> tuple[int, int]:
        """Returns a lane's number among its alternatives, from 1, and their number on its character."""
        layer = lane.layer
        alternatives = [
            alternative
            for alternative in lane.character.playing
            if alternative.alternatives == layer.alternatives
        ]
        names = list(dict.fromkeys(alternative.recorded for alternative in alternatives))
        return names.index(layer.recorded) + 1, len(names) if layer.alternatives else 1

    def _find_hidden_layers(self, playing: Sequence[LayerBase]) -> set[int]:
        """Returns the layers without a lane.

        They are inaudible takes in a closed group of alternatives.
        """
        takes_by_group: dict[str, dict[str, list[int]]] = {}
        for number, layer in enumerate(playing):
            if layer.alternatives and layer.alternatives not in self.opened:
                takes_by_group.setdefault(layer.alternatives, {}).setdefault(layer.recorded, []).append(
                    number
                )
        hidden = set[int]()
        for takes in takes_by_group.values():
            audible_names = [name for name, some in takes.items() if not all(playing[k].muted for k in some)]
            shown_name = audible_names[-1] if audible_names else list(takes)[-1]
            hidden.update(k for name, some in takes.items() if name != shown_name for k in some)
        return hidden

    def ticks(self) -> tuple[tuple[float, bool], ...]:
        """Returns the times to mark on the ruler, and whether each has a number.

        Numbers are at least 60 pixels apart.
        """
        min_step = 60.0 * self.visible_s / self.track
        step = next((s for s in _TICK_INTERVALS_S if s >= min_step), _TICK_INTERVALS_S[-1])
        small = step / 5
        first, last = -int(-self.start / small), int((self.start + self.visible_s) / small + 1e-9)
        return tuple((k * small, k % 5 == 0) for k in range(first, last + 1))

    def handle_at(self, x: float, y: float) -> LaneHandle:
        """Returns the part of the timeline under a pixel (hit test)."""
        if y < RULER_HEIGHT:
            return self._find_ruler_handle(x, y)
        for lane in self.lanes():
            if lane.top <= y < lane.top + lane.height:
                kind, item = self._find_lane_handle(lane, x)
                if kind != "nothing":
                    second = 0.0 if lane.kind in ("bar", "head") else self.second(lane, x)
                    return LaneHandle(kind, lane.character.id, lane.layers, item, second)
        return LaneHandle("ruler") if x >= LABEL_WIDTH - END_MARGIN else LaneHandle("nothing")

    def _find_ruler_handle(self, x: float, y: float) -> LaneHandle:
        near_markers = [
            (abs(at - x), marker.id) for marker, at in self.markers() if abs(at - x) <= MARKER_GRAB_DISTANCE
        ]
        if near_markers:
            return LaneHandle("marker", name=min(near_markers)[1])
        if self.marked is not None:
            low, high = (self.x(end) for end in self.marked)
            distance, kind = min((abs(high - x), "to"), (abs(low - x), "from"))
            if distance <= EDGE_GRAB_DISTANCE:
                return LaneHandle(kind)
            if low < x < high and y >= RULER_HEIGHT - SPAN_BAND_HEIGHT:
                return LaneHandle("marked")
        return LaneHandle("ruler") if x >= LABEL_WIDTH - END_MARGIN else LaneHandle("nothing")

    def _find_lane_handle(self, lane: Lane, x: float) -> tuple[str, int]:
        """Returns the kind and number of the part at a pixel of a lane."""
        if lane.kind == "head":
            if x >= LABEL_WIDTH - END_MARGIN:
                return "nothing", 0
            return (
                "fold"
                if x < MUTE_ICON_WIDTH
                else "solo"
                if x >= LABEL_WIDTH - END_MARGIN - SOLO_BUTTON_WIDTH
                else "name"
            ), 0
        if lane.kind != "bar" and self.details is not None:
            return self.details.at(self, lane, x)
        if x < LABEL_WIDTH - END_MARGIN:
            if x >= LABEL_WIDTH - END_MARGIN - TAKES_BUTTON_WIDTH and self.takes(lane)[1] > 1:
                return "takes", 0
            return ("mute" if x < MUTE_ICON_WIDTH else "lock" if x < 2 * MUTE_ICON_WIDTH else "label"), 0
        return self._find_clip_handle(lane, x)

    def _find_clip_handle(self, lane: Lane, x: float) -> tuple[str, int]:
        """Returns the clip, or the clip end, at a pixel of a bar.

        A narrow clip offers only its end and its middle.
        """
        ends = [(self.x(clip.begin), self.x(clip.end)) for clip in lane.clips]
        for k, ((_, right), (left, _)) in enumerate(pairwise(ends)):
            if (
                right - left > 2 * EDGE_GRAB_DISTANCE
                and left + EDGE_GRAB_DISTANCE < x < right - EDGE_GRAB_DISTANCE
            ):
                return "blend", k
        near_ends = [(abs(right - x), 0, k) for k, (_, right) in enumerate(ends)]
        near_ends += [
            (abs(left - x), 1, k)
            for k, (left, right) in enumerate(ends)
            if right - left > 3 * EDGE_GRAB_DISTANCE
        ]
        distance, side, number = min(near_ends)
        if distance <= EDGE_GRAB_DISTANCE:
            # If two clips touch, the side of the pointer decides which of them is trimmed.
            return ("begin" if side else "edge"), number
        inside = [k for k, (left, right) in enumerate(ends) if left <= x <= right]
        if not inside and lane.layer.loop and x >= lane.left:
            inside = [len(ends) - 1]
        return ("bar", inside[-1]) if inside else ("nothing", 0)
