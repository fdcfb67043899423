"""Where a step of the tour points: a widget by its name, or a place in the picture."""

from __future__ import annotations

from dataclasses import dataclass, field

from enliven_viewer.studio.viewport import Point

Rectangle = tuple[float, float, float, float]
"""Left, top, right, bottom in pixels."""
_STALE = 2
"""Pictures after which a widget that was not drawn again is gone: menus close, panels change."""


@dataclass(frozen=True)
class Target:
    """The target of a step.

    Attributes:
        widgets: names of widgets; the first that is drawn is meant.
        box: pixels of the picture, around what is meant there.
        path: the way to drag in the picture, in its pixels.
    """

    widgets: tuple[str, ...] = ()
    box: Rectangle | None = None
    path: tuple[Point, ...] = ()


@dataclass
class DrawnWidgets:
    """Where widgets were drawn, and in which picture; and the ones that are to be scrolled into sight.

    Attributes:
        picture: the number of the picture that is drawn.
        wanted: names of the widgets that are meant.
        left_alone: whether the artist scrolls, so that nothing else does.
    """

    picture: int = 0
    wanted: tuple[str, ...] = ()
    left_alone: bool = False
    _drawn: dict[str, tuple[int, Rectangle]] = field(default_factory=dict)

    def note(self, name: str, rectangle: Rectangle) -> None:
        """Notes where a widget is drawn in this picture."""
        self._drawn[name] = self.picture, rectangle

    def want(self, names: tuple[str, ...]) -> None:
        """Name the widgets that are meant from now on."""
        if names != self.wanted:
            self.wanted, self.left_alone = names, False

    def find(self, names: tuple[str, ...]) -> tuple[str, Rectangle] | None:
        """Returns the first of some widgets that is drawn now, and where; None if none is."""
        for name in names:
            picture, rectangle = self._drawn.get(name, (-_STALE - 1, (0.0, 0.0, 0.0, 0.0)))
            if self.picture - picture <= _STALE:
                return name, rectangle
        return None
