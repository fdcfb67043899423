"""The marks that a tool draws over the viewport, in its pixels, and the geometry that it draws into it."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.arrays import Float, Float32, Int32, UInt8
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


@dataclass(frozen=True, eq=False)
class ToolPicture:
    """The geometry that a tool draws into the 3D image, over the meshes.

    Attributes:
        self_intersection: vertices (V, 3) metres in the world, and the self-intersecting faces (K, 3) to
            highlight, or None.
        ghost: vertices (V, 3), faces, and size in metres of a mesh to outline, or None.
        shade: vertices (V, 3) metres in the world, faces, and (V, 4) uint8 sRGB and opacity to overlay; or
            None.
        tubes: rows of :class:`~enliven_viewer.render.overlay.tubes.Tubes`, and their depth bias in metres.
    """

    self_intersection: tuple[Float32, Int32] | None = None
    ghost: tuple[Float32, Int32, float] | None = None
    tubes: tuple[tuple[Float32, float], ...] = ()
    shade: tuple[Float | Float32, Int32, UInt8] | None = None


EMPTY_PICTURE = ToolPicture()
