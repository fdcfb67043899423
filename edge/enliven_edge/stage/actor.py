"""An actor that has performers choose a part before they drive it."""

from __future__ import annotations

from enliven.matching import Board, ScreenView
from enliven.possession import Actor


class ChosenActor(Actor):
    """An actor that has performers choose a part by posing before they drive them."""

    view: ScreenView
    """The direction from which the viewer sees it: poses are matched as they look on the screen."""

    def browse(self, step: int) -> None:
        """Shows another match; step 0 follows the pose again."""
        raise NotImplementedError

    def board(self) -> Board:
        """Returns the matches to choose from, or the chains that are driven, for viewers."""
        raise NotImplementedError
