"""The timeline's lanes of puppets: a bar a layer; under those of the chosen puppet its key poses, its
contacts and flights, and what is held hard. Everything that is drawn at a pixel is found there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from enliven.document import Project, Puppet, PuppetLayer, Switch
from enliven_viewer.studio.examples import HardConstraint, TakeCoverage, constraints_of
from enliven_viewer.studio.timeline.layout import EDGE, END, GAP, LABELS, LANE, MUTE, TimelineLayout

POSES = 30.0
"""Pixels, height of the row of key poses: the line of coverage and the diamonds over it."""
BAND = 15.0
"""Pixels, heights of the rows of contacts and of hard constraints."""
_NEAR = 7.0
"""Pixels around a mark within which the pointer takes it."""
_LABEL_END = LABELS - END

Kind = Literal["bar", "edge", "mute", "label", "pose", "suggested", "switch", "band", "found", "held"]
ROWS = ("bar", "poses", "band", "held")


@dataclass(frozen=True)
class PuppetLaneHandle:
    """The part of a puppet's lanes under the pointer.

    Attributes:
        layer: its number.
        item: which key pose, suggestion, switch or constraint.
        seconds: of the take, at the pixel.
    """

    kind: Kind
    puppet: str
    layer: int
    item: int = 0
    seconds: float = 0.0


@dataclass(frozen=True)
class LaneRow:
    """One row: "bar", "poses", "band" or "held", of a layer of a puppet, and its place."""

    kind: str
    puppet: str
    layer: int
    top: float
    height: float


@dataclass(frozen=True)
class PuppetLanes:
    """The lanes of a project's puppets, below those of its shapes.

    Attributes:
        layout: where times are, and where the lanes of shapes end.
        chosen: the id of the puppet that has rows of key poses, or None.
        coverage: of a take by the chosen puppet's examples.
        switches: of a layer of the chosen puppet, as edited or as found.
    """

    layout: TimelineLayout
    chosen: str | None
    coverage: Callable[[str], TakeCoverage | None]
    switches: Callable[[int], Sequence[Switch]]

    @property
    def project(self) -> Project:
        """The project of the layout."""
        return self.layout.project

    def layer(self, row: LaneRow | PuppetLaneHandle) -> PuppetLayer:
        """The layer of a row or a handle."""
        return self.project.puppets[row.puppet].layers[row.layer]

    def rows(self) -> tuple[LaneRow, ...]:
        """All rows, from the top."""
        top, found = self.layout.height - self.layout.scrolled, list[LaneRow]()
        for puppet in self.project.puppets.values():
            for number, layer in enumerate(puppet.layers):
                for kind, height in self._kinds(puppet, layer):
                    found.append(LaneRow(kind, puppet.id, number, top, height))
                    top += height + (GAP if kind == "bar" else 1.0)
                top += GAP
        return tuple(found)

    @property
    def height(self) -> float:
        """Pixels from the top of the first row to the end of the last."""
        rows = self.rows()
        return rows[-1].top + rows[-1].height - rows[0].top + GAP if rows else 0.0

    def x(self, row: LaneRow | PuppetLaneHandle, seconds: float) -> float:
        """The pixel of a second of a layer's take."""
        layer = self.layer(row)
        return self.layout.x(layer.time_of(seconds, self.project.takes[layer.take].duration))

    def seconds(self, row: LaneRow | PuppetLaneHandle, x: float) -> float:
        """The second of a layer's take at a pixel, within the take."""
        layer = self.layer(row)
        once = replace(layer, loop=False)
        return once.played(self.layout.time(x), self.project.takes[layer.take].duration)[0]

    def span(self, row: LaneRow | PuppetLaneHandle) -> tuple[float, float]:
        """First and last pixel of a layer's take, played once."""
        layer = self.layer(row)
        return self.layout.x(layer.offset), self.layout.x(layer.end(self.project.takes[layer.take].duration))

    def poses(self, row: LaneRow) -> tuple[tuple[int, float], ...]:
        """Number and pixel of the key poses that are of the layer's take."""
        layer, puppet = self.layer(row), self.project.puppets[row.puppet]
        return tuple(
            (number, self.x(row, pose.time))
            for number, pose in enumerate(puppet.poses)
            if pose.take == layer.take
        )

    def suggested(self, row: LaneRow) -> tuple[tuple[float, float], ...]:
        """Second and pixel of the key poses that are missing."""
        coverage = self.coverage(self.layer(row).take)
        return tuple((t, self.x(row, t)) for t in coverage.times) if coverage is not None else ()

    def bands(self, row: LaneRow) -> tuple[tuple[Switch, float, float], ...]:
        """Each switch with the pixels from which and up to which it holds."""
        take = self.project.takes[self.layer(row).take]
        switches = self.switches(row.layer)
        if not switches:
            return ()
        ends = [*(one.frame for one in switches[1:]), len(take.turns) - 1]
        return tuple(
            (one, self.x(row, one.frame * take.step), self.x(row, end * take.step))
            for one, end in zip(switches, ends, strict=True)
        )

    def held(self, row: LaneRow) -> tuple[tuple[int, HardConstraint, float], ...]:
        """Number, constraint and pixel of each hard constraint."""
        step = self.project.takes[self.layer(row).take].step
        held = constraints_of(self.project, row.puppet, row.layer)
        return tuple((k, one, self.x(row, one.frame * step)) for k, one in enumerate(held))

    def handle_at(self, x: float, y: float) -> PuppetLaneHandle | None:
        """The handle under a pixel; None where no lane of a puppet is."""
        for row in self.rows():
            if row.top <= y < row.top + row.height:
                kind, item = self._at(row, x)
                at = (row.puppet, row.layer, item, self.seconds(row, x))
                return PuppetLaneHandle(kind, *at) if kind is not None else None
        return None

    def _at(self, row: LaneRow, x: float) -> tuple[Kind | None, int]:
        if x < _LABEL_END:
            if row.kind == "bar":
                return ("mute" if x < MUTE else "label"), 0
            return ("found" if row.kind == "band" else "label"), 0
        if row.kind == "bar":
            return self._on_bar(row, x), 0
        if row.kind == "poses":
            near = [(abs(at - x), number) for number, at in self.poses(row) if abs(at - x) <= _NEAR]
            if near:
                return "pose", min(near)[1]
            ticks = [
                (abs(at - x), k) for k, (_, at) in enumerate(self.suggested(row)) if abs(at - x) <= _NEAR
            ]
            return ("suggested", min(ticks)[1]) if ticks else (None, 0)
        if row.kind == "band":
            starts = [(abs(left - x), k) for k, (_, left, _) in enumerate(self.bands(row)) if k]
            if starts and min(starts)[0] <= _NEAR - 2:
                return "switch", min(starts)[1]
            left, right = sorted(self.span(row))
            return ("band", 0) if left <= x <= right else (None, 0)
        marks = [(abs(at - x), k) for k, _, at in self.held(row) if abs(at - x) <= _NEAR]
        return ("held", min(marks)[1]) if marks else (None, 0)

    def _on_bar(self, row: LaneRow, x: float) -> Kind | None:
        left, right = self.span(row)
        if abs(x - right) <= EDGE:
            return "edge"
        return "bar" if left <= x <= right or (self.layer(row).loop and x >= left) else None

    def _kinds(self, puppet: Puppet, layer: PuppetLayer) -> tuple[tuple[str, float], ...]:
        """The rows of a layer and their heights."""
        rows = [("bar", LANE)]
        if puppet.id == self.chosen:
            rows.append(("poses", POSES))
            if layer.travel and any(point.foot for point in puppet.points):
                rows.append(("band", BAND))
            if layer.positions or layer.velocities or layer.couplings:
                rows.append(("held", BAND))
        return tuple(rows)
