"""Shows several edges in one space at one moment: transforms their worlds, aligns their clocks, and makes
their names unique.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence

from enliven.arrays import Float
from enliven.space.rigid_transform import invert
from enliven.space.space_file import Space
from enliven_viewer.language import tr
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.live.common_moment import CommonMoment
from enliven_viewer.live.followed_edge import FollowedEdge
from enliven_viewer.live.live_stage import LiveStage


class SharedSpace:
    """The transforms from the worlds of all edges to the world of the primary edge, which is shown.

    Args:
        show_message: called to show a message and its remedy.

    Attributes:
        space: the calibrated poses by the names of the edges. None shows all worlds unchanged.
    """

    def __init__(self, show_message: Callable[[str, str], None]) -> None:
        self._say = show_message
        self.space: Space | None = None
        self._reported: set[str] = set()
        self._prefixes: dict[tuple[int, str], str] = {}
        self._moment = CommonMoment()

    def prefix_of(self, number: int, edge: str) -> str:
        """Returns the prefix of the ids of an edge's characters: the edge's name, or a variant if that is
        taken.

        Args:
            number: number of the edge, 0 for the primary one.
            edge: name of the edge.
        """
        if (number, edge) not in self._prefixes:
            taken_names = set(self._prefixes.values())
            self._prefixes[number, edge] = edge if edge not in taken_names else f"{edge} ({number + 1})"
        return self._prefixes[number, edge]

    def update_transforms(self, primary: str, guests: Sequence[FollowedEdge]) -> None:
        """Sets the transforms of secondary edges. Reports edges that the calibrated space does not contain.

        Args:
            primary: name of the primary edge.
        """
        self.prefix_of(0, primary)
        heard_guests = [guest for guest in guests if guest.is_heard]
        for name, count in Counter([primary, *(guest.name for guest in heard_guests)]).items():
            if count > 1:
                self._report(
                    tr("{0} edges are named {1}", count, name),
                    tr("Start one of these edges with another name: --name NAME."),
                )
        for guest in heard_guests:
            guest.feed.transform = self.transform_between(primary, guest.name)

    def transform_between(self, primary: str, guest: str) -> Float | None:
        """Returns the (4, 4) transform from an edge's world to the primary edge's world, or None if it is
        unknown.
        """
        if self.space is None:
            return None
        for name in (primary, guest):
            if name not in self.space.sensors:
                names = ", ".join(self.space.sensors)
                self._report(
                    tr("The space file does not contain the edge {0}", name),
                    tr(
                        "The space file contains {0}. Start the edge with one of these names: --name NAME.",
                        names,
                    ),
                )
                return None
        places = self.space.sensors
        return invert(places[primary].level) @ places[guest].level

    def align_times(self, stages: Sequence[tuple[LiveStage, EdgeFeed]]) -> None:
        """Sets the delays of the stages so that all show the same moment."""
        newest = {}
        for index, (stage, feed) in enumerate(stages):
            time_ns = feed.newest_local_ns(stage.document) if stage.document.edge.connected else None
            if time_ns is not None:
                newest[index] = time_ns
        lags = self._moment.find_lags(newest, time.monotonic_ns())
        for index, (stage, _) in enumerate(stages):
            stage.playhead.lag_ns = lags.get(index, 0)

    def forget(self) -> None:
        """Forgets the names of disconnected edges."""
        self._prefixes.clear()
        self._reported.clear()
        self._moment = CommonMoment()

    def _report(self, problem: str, remedy: str) -> None:
        """Shows each problem once."""
        if problem not in self._reported:
            self._reported.add(problem)
            self._say(problem, remedy)
