"""The target of a tour step: a widget by its name, or a position in the image."""

from __future__ import annotations

from dataclasses import dataclass, field

from enliven_viewer.studio.viewport.overlay import Point

Rectangle = tuple[float, float, float, float]
"""Left, top, right, bottom in pixels."""
_STALE_FRAMES = 2
"""A widget that was not drawn for this number of frames counts as gone, for example because its menu was
closed.
"""


@dataclass(frozen=True)
class Target:
    """The target of a tour step.

    Attributes:
        widgets: names of widgets; the first one on screen is used.
        box: bounding box of the target in the image, in pixels.
        path: the drag path in the image, in pixels.
    """

    widgets: tuple[str, ...] = ()
    box: Rectangle | None = None
    path: tuple[Point, ...] = ()


@dataclass
class DrawnWidgets:
    """The rectangles of widgets, with the frame in which each was drawn, and the widgets to scroll to.

    Attributes:
        picture: number of the current frame.
        targets: names of the targeted widgets.
        is_user_scrolling: True if the artist is scrolling, so that the tour must not scroll.
    """

    picture: int = 0
    targets: tuple[str, ...] = ()
    is_user_scrolling: bool = False
    _rectangles: dict[str, tuple[int, Rectangle]] = field(default_factory=dict)

    def record(self, name: str, rectangle: Rectangle) -> None:
        """Records the rectangle of a widget in this frame."""
        self._rectangles[name] = self.picture, rectangle

    def set_targets(self, names: tuple[str, ...]) -> None:
        """Sets the targeted widgets."""
        if names != self.targets:
            self.targets, self.is_user_scrolling = names, False

    def find(self, names: tuple[str, ...]) -> tuple[str, Rectangle] | None:
        """Returns the name and rectangle of the first of several widgets that is on screen, or None if none
        is.
        """
        for name in names:
            picture, rectangle = self._rectangles.get(name, (-_STALE_FRAMES - 1, (0.0, 0.0, 0.0, 0.0)))
            if self.picture - picture <= _STALE_FRAMES:
                return name, rectangle
        return None
