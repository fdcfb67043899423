"""The layout of the timeline: ruler, lanes and playhead, and the handle under the pointer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.document import Playing, Project, Puppet

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
SLOWEST = 0.05
"""Speed of a layer at least, when its end is dragged: a twentieth."""
FASTEST = 20.0
"""Speed of a layer at most, when its end is dragged: twentyfold."""
SNAP = 6.0
"""Pixels within which a bar's start sticks to zero, to the playhead and to other bars' ends."""
_FEW = 12
"""Layers of a take that have a lane each; a model with more has a layer a bone, and they share lanes."""
_STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 300.0)
"""Seconds between two numbers of the ruler: round ones."""

Kind = Literal["ruler", "bar", "edge", "mute", "label", "nothing"]


@dataclass(frozen=True)
class LaneHandle:
    """The part of the timeline under the pointer, and the layers of a character that it belongs to."""

    kind: Kind
    character: str = ""
    layers: tuple[int, ...] = ()


@dataclass(frozen=True)
class Bar:
    """A lane: the numbers of its layers, its top, and the first and last pixel of the take played once.

    Layers of a character that play one take in the same way share a lane: a model that comes with its own
    animation has a layer for every bone.
    """

    character: str
    layers: tuple[int, ...]
    layer: Playing
    top: float
    left: float
    right: float

    @property
    def label(self) -> str:
        """The layer's id, or the take's and how many layers play it."""
        name = getattr(self.layer, "id", self.layer.take)
        return name if len(self.layers) == 1 else f"{self.layer.take}  ({len(self.layers)} bones)"


@dataclass(frozen=True)
class TimelineLayout:
    """The timeline of a project in an area with its top left at 0, 0.

    Attributes:
        project: its layers are shown.
        length: seconds that are shown.
        width: pixels of the whole area.
        scrolled: pixels by which the lanes are moved up.
    """

    project: Project
    length: float
    width: float
    scrolled: float = 0.0

    @property
    def track(self) -> float:
        """Pixels of the track's width."""
        return max(self.width - LABELS - END, 1.0)

    @property
    def height(self) -> float:
        """Pixels that ruler and lanes take."""
        return RULER + len(self.lanes()) * (LANE + GAP)

    def x(self, time: float) -> float:
        """The pixel of a time."""
        return LABELS + self.track * time / self.length

    def time(self, x: float) -> float:
        """The time of a pixel, seconds; outside the track it goes on."""
        return (x - LABELS) / self.track * self.length

    def lanes(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """The character and the numbers of its layers that share a lane, from the top."""
        groups: dict[tuple[object, ...], list[int]] = {}
        for key, character in self.project.characters.items():
            if isinstance(character, Puppet):
                continue  # its lanes have rows of their own
            playing = character.playing
            for number, layer in enumerate(playing):
                few = sum(other.take == layer.take for other in playing) <= _FEW
                alone = number if few and character.kind == "bones" else -1
                how = (layer.take, layer.offset, layer.speed, layer.loop, layer.muted)
                groups.setdefault((key, *how, alone), []).append(number)
        return tuple((str(group[0]), tuple(numbers)) for group, numbers in groups.items())

    def bars(self) -> tuple[Bar, ...]:
        """The lanes, from the top."""
        bars = []
        for row, (character, numbers) in enumerate(self.lanes()):
            layer = self.project.characters[character].playing[numbers[0]]
            top = RULER + row * (LANE + GAP) - self.scrolled
            left, right = self.x(layer.offset), self.x(layer.end(self.project.length_of(layer)))
            bars.append(Bar(character, numbers, layer, top, left, right))
        return tuple(bars)

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
        for bar in self.bars():
            if not bar.top <= y < bar.top + LANE:
                continue
            if x < MUTE:
                return LaneHandle("mute", bar.character, bar.layers)
            if x < LABELS - END:
                return LaneHandle("label", bar.character, bar.layers)
            if abs(x - bar.right) <= EDGE:
                return LaneHandle("edge", bar.character, bar.layers)
            if bar.left <= x <= bar.right or (bar.layer.loop and x >= bar.left):
                return LaneHandle("bar", bar.character, bar.layers)
        return LaneHandle("ruler") if x >= LABELS - END else LaneHandle("nothing")
