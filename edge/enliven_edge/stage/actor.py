"""Base class of actors that let performers choose a part before they drive it."""

from __future__ import annotations

from enliven.matching.match_list import MatchList
from enliven.matching.views import ScreenView
from enliven.possession import Actor


class ChosenActor(Actor):
    """An actor that lets performers choose a part by posing, before they drive that part."""

    view: ScreenView
    """The viewer's direction of view. Poses are compared as they appear on the viewer's screen."""

    def browse(self, step: int) -> None:
        """Shows another match. Step 0 makes the shown match follow the pose again."""
        raise NotImplementedError

    def board(self) -> MatchList:
        """Returns the list of matches to choose from, or the driven chains, for viewers."""
        raise NotImplementedError
