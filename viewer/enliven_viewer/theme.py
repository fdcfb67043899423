"""The typeface and the colours of the window and the studio: glass and amber, on the renderer's dusk."""

from __future__ import annotations

FONT = "fonts/Roboto/Roboto-Regular.ttf"
"""The typeface, as ImGui's bundle brings it."""

Colour = tuple[float, float, float, float]
"""sRGB and opacity, 0..1 each."""

INK: Colour = (0.95, 0.96, 0.98, 0.96)
"""Text: bright on the dark panels."""
QUIET: Colour = (0.78, 0.81, 0.86, 0.85)
"""Text of less weight."""
GLASS: Colour = (0.05, 0.06, 0.085, 0.58)
"""Panels over the picture: dark enough to read on, and the stage shows through."""
ACCENT: Colour = (1.0, 0.69, 0.30, 1.0)
"""Amber: what is active or live."""
GOOD: Colour = (0.24, 0.80, 0.72, 1.0)
"""Bluish green: all is well. Eyes that mix up red and green still tell it from the next two."""
WAIT: Colour = (1.0, 0.82, 0.36, 1.0)
"""Yellow: a warning, or something that is waited for."""
BAD: Colour = (0.98, 0.36, 0.27, 1.0)
"""Vermilion: an error."""
TRACK: Colour = (1.0, 1.0, 1.0, 0.20)
"""The part of the timeline that was not played yet."""
FAINT: Colour = (0.78, 0.81, 0.86, 0.42)
"""Bones that no limb of the performer drives."""

PANEL: Colour = (0.082, 0.092, 0.115, 1.0)
"""Panels: darker than the stage, so that the work is the brightest."""
RAISED: Colour = (0.125, 0.139, 0.170, 1.0)
"""Buttons, fields and boxes on a panel."""
PRESSED: Colour = (0.19, 0.21, 0.255, 1.0)
"""A button or field under the pointer or pressed."""
LINE: Colour = (1.0, 1.0, 1.0, 0.09)
"""Lines between parts: barely seen."""
DARK: Colour = (0.055, 0.062, 0.078, 1.0)
"""Views and lanes within a panel: deeper than the panel."""
STROKE: Colour = (1.0, 0.80, 0.36, 1.0)
"""A stroke that is being sketched."""
CUT: Colour = (1.0, 0.42, 0.36, 1.0)
"""A stroke that cuts, and the places where it does."""
CHAIN: Colour = (0.36, 0.92, 0.86, 1.0)
"""A chain of joints, in overlays and lists."""

BONE = (226, 232, 242)
"""sRGB of bones of the selected shape."""
FADED = (138, 150, 172)
"""sRGB of bones of other shapes: dimmer."""
CHOSEN = (255, 176, 76)
"""sRGB of the chosen joint: the amber of whatever is active."""
HOVERED = (255, 226, 160)
"""sRGB of the joint under the pointer: between plain and chosen."""
CHAINED = (92, 232, 220)
"""sRGB of a chain of joints: as in overlays."""
ROOT = (255, 120, 96)
"""sRGB of the root joint, which moves the whole shape."""

DEFAULT_COLOURS = (
    (226, 142, 84),
    (118, 164, 190),
    (150, 176, 120),
    (206, 128, 138),
    (196, 170, 110),
    (142, 138, 190),
)
"""sRGB of meshes that bring no colours; which one follows from the shape's name."""

LANES: tuple[Colour, ...] = (
    (0.93, 0.60, 0.33, 1.0),
    (0.36, 0.72, 0.78, 1.0),
    (0.60, 0.74, 0.42, 1.0),
    (0.80, 0.50, 0.62, 1.0),
    (0.62, 0.58, 0.84, 1.0),
    (0.83, 0.72, 0.42, 1.0),
)
"""Bars of the timeline, a colour a take."""

AXES = ((236, 92, 84), (128, 206, 92), (92, 146, 246))
"""sRGB of the manipulator's x, y and z: red, green, blue, as every 3-D program has them."""
HELD_AXIS = (255, 226, 160)
"""sRGB of the part of the manipulator under the pointer."""
WARNING = (255, 74, 58)
"""sRGB of faces that pass through one another."""
GHOST = (150, 226, 255)
"""sRGB of the outline of the key pose before."""

BEFORE = (96, 160, 255)
"""sRGB of where a character was: blue, which eyes that mix up red and green tell from the next."""
AFTER = (255, 156, 72)
"""sRGB of where a character will be: orange."""

POINTS = (
    (255, 196, 84),
    (92, 200, 250),
    (150, 220, 110),
    (250, 130, 170),
    (180, 150, 255),
    (90, 226, 206),
    (255, 150, 90),
    (214, 222, 120),
)
"""sRGB of control points, in turn: on the stage, in lists, and of the joints that they are paired with."""


def point_colour(number: int) -> tuple[int, int, int]:
    """The sRGB of a control point, by its number on the puppet."""
    return POINTS[number % len(POINTS)]
