"""The rows below the bars of puppets: key poses, ground contacts and flight phases, and hard constraints.

Drawing and hit testing use the same positions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from enliven.document import ExampleCharacter, PuppetLayer, RigBase, Switch
from enliven_viewer.studio.features.timeline.layout import END_MARGIN, LABEL_WIDTH, Lane, TimelineLayout
from enliven_viewer.studio.puppets.coverage import TakeCoverage
from enliven_viewer.studio.puppets.example_edits import HardConstraint, list_constraints

POSE_ROW_HEIGHT = 30.0
"""Height in pixels of the row of key poses: the coverage curve with diamonds over it."""
BAND_ROW_HEIGHT = 15.0
"""Height in pixels of the rows of contacts and of hard constraints."""
_CLICK_DISTANCE_PX = 7.0
"""Distance in pixels within which a mark can be clicked."""


@dataclass(frozen=True)
class PuppetDetails:
    """The rows below the bars of the selected puppet: "poses", "band" and "held".

    Attributes:
        chosen: the puppet that has the rows, or None.
        coverage: returns how well the examples cover a take.
        switches: returns the edited or detected contact switches of a layer.
    """

    chosen: ExampleCharacter | None
    coverage: Callable[[str], TakeCoverage | None]
    switches: Callable[[int], Sequence[Switch]]

    def rows(self, character: RigBase, number: int) -> Sequence[tuple[str, float]]:
        """Returns the kinds and heights in pixels of the rows below a layer's bar."""
        puppet = self.chosen
        if puppet is None or character is not puppet or number >= len(puppet.layers):
            return ()  # Layers that move only the root have no rows.
        layer = puppet.layers[number]
        rows = [("poses", POSE_ROW_HEIGHT)]
        if layer.travel and any(point.foot for point in puppet.points):
            rows.append(("band", BAND_ROW_HEIGHT))
        if layer.positions or layer.velocities or layer.couplings:
            rows.append(("held", BAND_ROW_HEIGHT))
        return rows

    def poses(self, layout: TimelineLayout, lane: Lane) -> tuple[tuple[int, float], ...]:
        """Returns the number and the x coordinate of each key pose of the layer's take."""
        poses = self.chosen.poses if self.chosen is not None else ()
        return tuple(
            (number, layout.find_x(lane, pose.time))
            for number, pose in enumerate(poses)
            if pose.take == lane.layer.take and _is_time_played(layout, lane, pose.time)
        )

    def suggest_marks(self, layout: TimelineLayout, lane: Lane) -> tuple[tuple[float, float], ...]:
        """Returns the time and the x coordinate of each missing (suggested) key pose."""
        coverage = self.coverage(lane.layer.take)
        times = coverage.times if coverage is not None else ()
        return tuple((t, layout.find_x(lane, t)) for t in times if _is_time_played(layout, lane, t))

    def bands(self, layout: TimelineLayout, lane: Lane) -> tuple[tuple[Switch, float, float], ...]:
        """Returns each switch with the x coordinates of the start and end of its phase."""
        take, switches = layout.project.takes[lane.layer.take], self.switches(lane.layers[0])
        ends = [*(switch.frame for switch in switches[1:]), len(take.turns) - 1][: len(switches)]
        return tuple(
            (switch, layout.find_x(lane, switch.frame * take.step), layout.find_x(lane, end * take.step))
            for switch, end in zip(switches, ends, strict=True)
        )

    def constraint_marks(
        self, layout: TimelineLayout, lane: Lane
    ) -> tuple[tuple[int, HardConstraint, float], ...]:
        """Returns the number, the constraint and the x coordinate of each hard constraint."""
        step = layout.project.takes[lane.layer.take].step
        constraints = list_constraints(layout.project, lane.character.id, lane.layers[0])
        return tuple(
            (k, constraint, layout.find_x(lane, constraint.frame * step))
            for k, constraint in enumerate(constraints)
        )

    def find_mark(self, layout: TimelineLayout, lane: Lane, x: float) -> tuple[str, int]:
        """Returns the kind and number of the mark at a pixel of a row."""
        if x < LABEL_WIDTH - END_MARGIN:
            return ("found" if lane.kind == "band" else "label"), 0
        if lane.kind == "poses":
            pose = _find_nearest_mark(
                ((number, mark_x) for number, mark_x in self.poses(layout, lane)), x, _CLICK_DISTANCE_PX
            )
            tick = _find_nearest_mark(
                ((k, mark_x) for k, (_, mark_x) in enumerate(self.suggest_marks(layout, lane))),
                x,
                _CLICK_DISTANCE_PX,
            )
            return (
                ("pose", pose)
                if pose is not None
                else ("nothing" if tick is None else "suggested", tick or 0)
            )
        if lane.kind == "band":
            starts = ((k, left) for k, (_, left, _) in enumerate(self.bands(layout, lane)) if k)
            switch = _find_nearest_mark(starts, x, _CLICK_DISTANCE_PX - 2)
            if switch is not None:
                return "switch", switch
            left, right = sorted((lane.left, lane.right))
            return ("band" if left <= x <= right else "nothing"), 0
        mark = _find_nearest_mark(
            ((k, mark_x) for k, _, mark_x in self.constraint_marks(layout, lane)), x, _CLICK_DISTANCE_PX
        )
        return ("nothing" if mark is None else "held"), mark or 0

    def layer(self, number: int) -> PuppetLayer:
        """Returns a layer of the chosen puppet."""
        assert self.chosen is not None
        return self.chosen.layers[number]


def _is_time_played(layout: TimelineLayout, lane: Lane, second: float) -> bool:
    """Returns True if a clip plays a time of the take, so that the time is not trimmed off."""
    return lane.layer.plays(second, layout.project.length_of(lane.layer))


def _find_nearest_mark(marks: Iterable[tuple[int, float]], x: float, reach: float) -> int | None:
    """Returns the number of the mark nearest to a pixel, or None if it is farther than ``reach`` pixels."""
    near = [(abs(mark_x - x), number) for number, mark_x in marks if abs(mark_x - x) <= reach]
    return min(near)[1] if near else None
