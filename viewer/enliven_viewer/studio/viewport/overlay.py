"""What a tool draws over the viewport: lines, discs and words, in the viewport's pixels."""

from __future__ import annotations

from dataclasses import dataclass

from enliven_viewer.theme import Colour

Point = tuple[float, float]


@dataclass(frozen=True)
class Line:
    """A polyline; ``closed`` joins its last point to its first."""

    points: tuple[Point, ...]
    colour: Colour
    width: float = 2.0
    closed: bool = False


@dataclass(frozen=True)
class Disc:
    """A disc, or with ``width`` above 0 the ring around it."""

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
    """A line of text with its left middle at a place."""

    at: Point
    text: str
    colour: Colour


@dataclass(frozen=True)
class Overlay:
    """Everything that a tool shows.

    Attributes:
        marks: lines, discs, areas and words, the first undermost.
        chain: the character and the joints of bones that are lit, or None.
        hovered: the character and the handle under the pointer, or None.
    """

    marks: tuple[Line | Disc | Fill | Label, ...] = ()
    chain: tuple[str, tuple[int, ...]] | None = None
    hovered: tuple[str, int] | None = None
