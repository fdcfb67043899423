"""The marks that a tool draws over the viewport: lines, discs and labels, in the viewport's pixels."""

from __future__ import annotations

from dataclasses import dataclass

from enliven_viewer.theme import Colour

Point = tuple[float, float]


@dataclass(frozen=True)
class Line:
    """A polyline. ``closed`` joins its last point to its first."""

    points: tuple[Point, ...]
    colour: Colour
    width: float = 2.0
    closed: bool = False


@dataclass(frozen=True)
class Disc:
    """A disc, or a ring if ``width`` is above 0."""

    at: Point
    radius: float
    colour: Colour
    width: float = 0.0


@dataclass(frozen=True)
class Fill:
    """A filled convex area."""

    points: tuple[Point, ...]
    colour: Colour


@dataclass(frozen=True)
class Label:
    """A line of text. `at` is the centre of its left edge in pixels."""

    at: Point
    text: str
    colour: Colour


@dataclass(frozen=True)
class Overlay:
    """All marks of a tool.

    Attributes:
        marks: lines, discs, areas and labels in drawing order.
        chain: the character and the joints of highlighted bones, or None.
        hovered: the character and the handle under the pointer, or None.
    """

    marks: tuple[Line | Disc | Fill | Label, ...] = ()
    chain: tuple[str, tuple[int, ...]] | None = None
    hovered: tuple[str, int] | None = None
