"""The layout of the timeline: ruler, lanes and playhead, and the handle under the pointer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from enliven.document import Playing, Project, RigBase

LABELS = 190.0
"""Pixels, width of the labels: about 25 letters."""
RULER = 26.0
"""Pixels, height of the ruler."""
LANE = 24.0
"""Pixels, height of a lane: a line of text."""
GAP = 3.0
"""Pixels between two lanes."""
END = 12.0
"""Pixels that are left free at the right, so that the last bar's end can be taken."""
EDGE = 7.0
"""Pixels around a bar's right end that change its speed."""
MUTE = 22.0
"""Pixels at the left of a label that mute the layer: as wide as the icon of the eye."""
SNAP = 6.0
"""Pixels within which a bar's start sticks to zero, to the playhead and to other bars' ends."""
_FEW = 12
"""Layers of a take that have a lane each; a model with more has a layer a bone, and they share lanes."""
_STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 300.0)
"""Seconds between two numbers of the ruler: round ones."""


@dataclass(frozen=True)
class LaneHandle:
    """The part of the timeline under the pointer.

    Attributes:
        kind: "ruler", "bar", "edge", "mute", "label", "nothing"; or of a row of details.
        character, layers: of what it is a part.
        item: which of those in a row of details.
        seconds: of the layer's take, at the pixel.
    """

    kind: str
    character: str = ""
    layers: tuple[int, ...] = ()
    item: int = 0
    seconds: float = 0.0

    @property
    def number(self) -> int:
        """The first of the layers."""
        return self.layers[0]


@dataclass(frozen=True)
class Lane:
    """A row: a bar, or details of a layer; and the first and last pixel of the take played once.

    Layers of a character that play one take in the same way share a bar: a model that comes with its own
    animation has a layer for every bone.
    """

    kind: str
    character: RigBase
    layers: tuple[int, ...]
    top: float
    height: float
    left: float
    right: float

    @property
    def layer(self) -> Playing:
        """The first of its layers."""
        return self.character.playing[self.layers[0]]

    @property
    def label(self) -> str:
        """The layer's id or else the character's, or the take's and how many layers play it."""
        if len(self.layers) > 1:
            return f"{self.layer.take}  ({len(self.layers)} bones)"
        return str(getattr(self.layer, "id", self.character.id))


class Details(Protocol):
    """What a rig shows under the bars of its layers."""

    def rows(self, character: RigBase, number: int) -> Sequence[tuple[str, float]]:
        """The kinds and heights in pixels of the rows under a layer's bar."""

    def at(self, layout: TimelineLayout, lane: Lane, x: float) -> tuple[str, int]:
        """What is at a pixel of such a row, and which; "nothing" where nothing is."""


@dataclass(frozen=True)
class TimelineLayout:
    """The timeline of a project in an area with its top left at 0, 0.

    Attributes:
        project: its layers are shown.
        length: seconds that are shown.
        width: pixels of the whole area.
        scrolled: pixels by which the lanes are moved up.
        details: what rigs show under their bars.
    """

    project: Project
    length: float
    width: float
    scrolled: float = 0.0
    details: Details | None = None

    @property
    def track(self) -> float:
        """Pixels of the track's width."""
        return max(self.width - LABELS - END, 1.0)

    @property
    def height(self) -> float:
        """Pixels that ruler and lanes take."""
        lanes = self.lanes()
        return lanes[-1].top + lanes[-1].height + GAP + self.scrolled if lanes else RULER

    def x(self, time: float) -> float:
        """The pixel of a time."""
        return LABELS + self.track * time / self.length

    def time(self, x: float) -> float:
        """The time of a pixel, seconds; outside the track it goes on."""
        return (x - LABELS) / self.track * self.length

    def x_of(self, lane: Lane, second: float) -> float:
        """The pixel of a second of a lane's take."""
        return self.x(lane.layer.time_of(second, self.project.length_of(lane.layer)))

    def second(self, lane: Lane, x: float) -> float:
        """The second of a lane's take at a pixel, within the take."""
        once = replace(lane.layer, loop=False)
        return once.played(self.time(x), self.project.length_of(once))[0]

    def lanes(self) -> tuple[Lane, ...]:
        """All rows, from the top: of each layer a bar, and under it what its rig shows."""
        top, found = RULER - self.scrolled, list[Lane]()
        for name, numbers in self._shared():
            character = self.project.characters[name]
            layer = character.playing[numbers[0]]
            span = self.x(layer.offset), self.x(layer.end(self.project.length_of(layer)))
            rows = self.details.rows(character, numbers[0]) if self.details is not None else ()
            for kind, height in (("bar", LANE), *rows):
                found.append(Lane(kind, character, numbers, top, height, *span))
                top += height + 1.0
            top += GAP - 1.0
        return tuple(found)

    def bars(self) -> tuple[Lane, ...]:
        """The lanes that are bars, from the top."""
        return tuple(lane for lane in self.lanes() if lane.kind == "bar")

    def _shared(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """The character and the numbers of its layers that share a bar, from the top."""
        groups: dict[tuple[object, ...], list[int]] = {}
        for key, character in self.project.characters.items():
            playing = character.playing
            for number, layer in enumerate(playing):
                few = sum(other.take == layer.take for other in playing) <= _FEW
                alone = number if few and layer.source == "takes" else -1
                how = (layer.take, layer.muted, layer.when())
                groups.setdefault((key, *how, alone), []).append(number)
        return tuple((str(group[0]), tuple(numbers)) for group, numbers in groups.items())

    def ticks(self) -> tuple[tuple[float, bool], ...]:
        """Times to mark on the ruler, and whether each is numbered; numbers stand 60 pixels apart or more."""
        wanted = 60.0 * self.length / self.track
        step = next((s for s in _STEPS if s >= wanted), _STEPS[-1])
        small = step / 5
        count = int(self.length / small + 1e-9)
        return tuple((k * small, k % 5 == 0) for k in range(count + 1))

    def handle_at(self, x: float, y: float) -> LaneHandle:
        """The handle under a pixel."""
        if y < RULER:
            return LaneHandle("ruler") if x >= LABELS - END else LaneHandle("nothing")
        for lane in self.lanes():
            if lane.top <= y < lane.top + lane.height:
                kind, item = self._at(lane, x)
                if kind != "nothing":
                    second = 0.0 if lane.kind == "bar" else self.second(lane, x)
                    return LaneHandle(kind, lane.character.id, lane.layers, item, second)
        return LaneHandle("ruler") if x >= LABELS - END else LaneHandle("nothing")

    def _at(self, lane: Lane, x: float) -> tuple[str, int]:
        """What is at a pixel of a lane."""
        if lane.kind != "bar" and self.details is not None:
            return self.details.at(self, lane, x)
        if x < LABELS - END:
            return ("mute" if x < MUTE else "label"), 0
        if abs(x - lane.right) <= EDGE:
            return "edge", 0
        on = lane.left <= x <= lane.right or (lane.layer.loop and x >= lane.left)
        return ("bar" if on else "nothing"), 0
