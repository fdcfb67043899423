"""The layout of the timeline: ruler, lanes grouped by character, clips, and hit testing."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Protocol

from enliven.document import LayerBase, Marker, Project, RigBase, RiggedCharacter, Segment
from enliven_viewer.language import tr
from enliven_viewer.studio.app.lane_groups import group_layers
from enliven_viewer.studio.app.time_axis import END_MARGIN, LABEL_WIDTH, RULER_HEIGHT, TimeScale

_PLAIN_WORDS = {"girdle": "shoulder", "trunk": "body", "whole": "whole body", "way": "path"}
"""The displayed words for limb names of the retargeting code."""
_LEG_WORDS = {"shoulder": "hip"}
"""The displayed word for a girdle to which legs are attached."""


def make_lane_name(character: RigBase, layer: LayerBase) -> str:
    """Returns the label of a layer's lane, such as "left arm, wave".

    A narrow lane shows only its beginning.
    """
    name = str(getattr(layer, "id", character.id))
    take, _, limb = name.partition(": ")
    if limb:
        return f"{describe_limb(limb)}, {take}"
    if not isinstance(character, RiggedCharacter) or (
        name != layer.take and not name.startswith(f"{layer.take} ")
    ):
        return name
    lanes_of_take = sum(other.take == layer.take for other in character.playing)
    limb = _find_driven_joint(character, name) if lanes_of_take > 1 else ""
    return f"{limb}, {name}" if limb else name


def describe_limb(role: str) -> str:
    """Returns a limb's name in an artist's words: "left hip" for "left leg 1 girdle"."""
    words = [word for word in role.split() if not re.fullmatch(r"1", word)]
    plain = [_PLAIN_WORDS.get(word, word) for word in words]
    if "shoulder" in plain:
        legs = any(word.startswith("leg") for word in plain)
        joint = _LEG_WORDS["shoulder"] if legs else "shoulder"
        sides = [word for word in plain if word in ("left", "right")]
        numbers = [word for word in plain if word.isdecimal()]
        return " ".join([*sides, joint, *numbers])
    return " ".join(plain)


def _find_driven_joint(shape: RiggedCharacter, layer_id: str) -> str:
    """Returns the end joint of the bones that a layer drives, or an empty text if it drives all bones or
    none.
    """
    driven = [
        joint
        for joint, spans in enumerate(shape.spans)
        if any(ref.layer == layer_id for span in spans for ref in span.refs)
    ]
    if not driven or len(driven) >= len(shape.skeleton) - 1:
        return ""
    return shape.skeleton.names[driven[-1]].removesuffix(" end")


LANE_HEIGHT = 28.0
"""Height of a lane in pixels: a line of text over thumbnails."""
HEAD_HEIGHT = 20.0
"""Height, in pixels, of the row with a character's name above its lanes."""
LANE_GAP = 3.0
"""Gap between two lanes in pixels."""
EDGE_GRAB_DISTANCE = 7.0
"""Distance in pixels from a clip's end within which a drag trims the clip, or changes its speed with Ctrl."""
MUTE_ICON_WIDTH = 22.0
"""Width in pixels of an icon at the left of a label: mute (eye), lock, or fold."""
SOLO_BUTTON_WIDTH = 20.0
"""Width in pixels of the solo button at the right of a character's label."""
TAKES_BUTTON_WIDTH = 34.0
"""Width in pixels of the take number at the right of a label. A click on it opens the alternative takes."""
SPAN_BAND_HEIGHT = 8.0
"""Height in pixels of the band on the ruler that shows the recording range."""
MARKER_GRAB_DISTANCE = 6.0
"""Distance in pixels from a marker on the ruler within which it can be grabbed."""


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
        """Returns the number of the first layer."""
        return self.layers[0]


@dataclass(frozen=True)
class Lane:
    """A row of the timeline: a bar, details of a layer, or a character's name.

    Its left and right are the first and last pixel of its clips. Layers of a character that play the same
    take in the same way share a bar, because an imported animation has a layer for every bone.

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
        """Returns the label: the moving limb and its take, or the take and the number of layers
        that play it.
        """
        if len(self.layers) > 1:
            return tr("{0}  ({1} bones)", self.layer.take, len(self.layers))
        return make_lane_name(self.character, self.layer)


class Details(Protocol):
    """Provides the rows below the bars of a rig's layers."""

    def rows(self, character: RigBase, number: int) -> Sequence[tuple[str, float]]:
        """Returns the kinds and heights in pixels of the rows below a layer's bar."""

    def find_mark(self, layout: TimelineLayout, lane: Lane, x: float) -> tuple[str, int]:
        """Returns the kind and number of the mark at a pixel of a row from :meth:`rows`; "nothing" if there
        is none.
        """


@dataclass(frozen=True, kw_only=True)
class TimelineLayout(TimeScale):
    """The layout of a project's timeline in an area with its top left corner at 0, 0.

    Attributes:
        project: the project with the shown layers.
        scrolled: vertical scroll offset of the lanes in pixels.
        details: the rows that rigs show below their bars.
        folded: the characters with all lanes collapsed into one row.
        opened: groups of alternative takes that show a lane for every take. Other groups show only the active
            take.
        marked: start and end of recordings in seconds, or None.
    """

    project: Project
    scrolled: float = 0.0
    details: Details | None = None
    folded: frozenset[str] = frozenset()
    opened: frozenset[str] = frozenset()
    marked: tuple[float, float] | None = None

    @property
    def height(self) -> float:
        """Returns the total height of ruler and lanes in pixels."""
        lanes = self.lanes()
        return lanes[-1].top + lanes[-1].height + LANE_GAP + self.scrolled if lanes else RULER_HEIGHT

    def find_x(self, lane: Lane, second: float) -> float:
        """Returns the x coordinate of a time in a lane's take."""
        return self.x(lane.layer.time_of(second, self.project.length_of(lane.layer)))

    def find_take_time(self, lane: Lane, x: float) -> float:
        """Returns the time in a lane's take at an x coordinate, clamped to the take."""
        once = replace(lane.layer, loop=False)
        return once.find_played_time(self.time(x), self.project.length_of(once))[0]

    def lanes(self) -> tuple[Lane, ...]:
        """Returns all rows from the top: a bar for each layer, and the details of its rig below it."""
        return self._cached_lanes

    @cached_property
    def _cached_lanes(self) -> tuple[Lane, ...]:
        top, lanes = RULER_HEIGHT - self.scrolled, list[Lane]()
        shared = group_layers(self.project, self.opened)
        named, previous_name = len({name for name, _ in shared}) > 1, ""
        for name, numbers in shared:
            character = self.project.characters[name]
            layer = character.playing[numbers[0]]
            if named and name != previous_name:
                every = tuple(
                    number for other, layer_numbers in shared if other == name for number in layer_numbers
                )
                lanes.append(Lane("head", character, every, top, HEAD_HEIGHT, LABEL_WIDTH, LABEL_WIDTH))
                top, previous_name = top + HEAD_HEIGHT + 1.0, name
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

    def takes(self, lane: Lane) -> tuple[int, int]:
        """Returns the number of a lane's take among its alternatives, counted from 1, and the number of
        alternatives.
        """
        layer = lane.layer
        alternatives = [
            alternative
            for alternative in lane.character.playing
            if alternative.alternatives == layer.alternatives
        ]
        names = list(dict.fromkeys(alternative.recorded for alternative in alternatives))
        return names.index(layer.recorded) + 1, len(names) if layer.alternatives else 1

    def handle_at(self, x: float, y: float) -> LaneHandle:
        """Returns the part of the timeline under a pixel (hit test)."""
        if y < RULER_HEIGHT:
            return self._find_ruler_handle(x, y)
        for lane in self.lanes():
            if lane.top <= y < lane.top + lane.height:
                kind, item = self._find_lane_handle(lane, x)
                if kind != "nothing":
                    second = 0.0 if lane.kind in ("bar", "head") else self.find_take_time(lane, x)
                    return LaneHandle(kind, lane.character.id, lane.layers, item, second)
        return LaneHandle("ruler") if x >= LABEL_WIDTH - END_MARGIN else LaneHandle("nothing")

    def _find_ruler_handle(self, x: float, y: float) -> LaneHandle:
        near_markers = [
            (abs(marker_x - x), marker.id)
            for marker, marker_x in self.markers()
            if abs(marker_x - x) <= MARKER_GRAB_DISTANCE
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
            return self.details.find_mark(self, lane, x)
        if x < LABEL_WIDTH - END_MARGIN:
            if x >= LABEL_WIDTH - END_MARGIN - TAKES_BUTTON_WIDTH and self.takes(lane)[1] > 1:
                return "takes", 0
            return ("mute" if x < MUTE_ICON_WIDTH else "lock" if x < 2 * MUTE_ICON_WIDTH else "label"), 0
        return self._find_clip_handle(lane, x)

    def _find_clip_handle(self, lane: Lane, x: float) -> tuple[str, int]:
        """Returns the kind and number of the clip, or clip end, at a pixel of a bar. On a narrow clip, only
        its end and its middle can be grabbed.
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
            # If two clips touch, the clip under the pointer is trimmed.
            return ("begin" if side else "edge"), number
        inside = [k for k, (left, right) in enumerate(ends) if left <= x <= right]
        if not inside and lane.layer.loop and x >= lane.left:
            inside = [len(ends) - 1]
        return ("bar", inside[-1]) if inside else ("nothing", 0)
