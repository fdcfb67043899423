"""The typeface and all colours of the window and the studio: two themes, and two palettes.

A colour is a name such as ``INK``. It evaluates to the numbers of the current theme, so :func:`use_theme`
changes every colour at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

FONT = "fonts/Roboto/Roboto-Regular.ttf"
"""The typeface, from ImGui's bundle."""

Colour = Sequence[float]
"""sRGB and opacity, four numbers from 0 to 1."""
Paint = Sequence[int]
"""sRGB of an object in the 3D view, three numbers from 0 to 255."""
Rgba = tuple[float, float, float, float]
Rgb = tuple[int, int, int]
ThemeName = Literal["dark", "light"]
ColourSetName = Literal["usual", "okabe-ito"]
Look = Literal["studio", "bright", "night", "white", "dawn", "garden"]


@dataclass(frozen=True)
class Theme:
    """The colours of a theme. The constants below describe the use of each.

    Attributes:
        look: the preset of light and backdrop that replaces the stage's preset "studio" in this theme.
    """

    look: Literal["studio", "bright"]
    ink: Rgba
    quiet: Rgba
    faint: Rgba
    accent: Rgba
    good: Rgba
    wait: Rgba
    bad: Rgba
    glass: Rgba
    panel: Rgba
    raised: Rgba
    pressed: Rgba
    dark: Rgba
    popup: Rgba
    dimmed: Rgba
    line: Rgba
    track: Rgba
    stroke: Rgba
    cut: Rgba
    chain: Rgba
    mark: Rgba
    shadow: Rgba
    bone: Rgb
    faded: Rgb
    chosen: Rgb
    hovered: Rgb
    chained: Rgb
    root: Rgb
    axes: tuple[Rgb, Rgb, Rgb]
    held_axis: Rgb
    warning: Rgb
    ghost: Rgb
    before: Rgb
    after: Rgb
    glance_far: Rgb
    glance_near: Rgb


THEMES: dict[ThemeName, Theme] = {
    "dark": Theme(
        look="studio",
        ink=(0.95, 0.96, 0.98, 0.96),
        quiet=(0.78, 0.81, 0.86, 0.85),
        faint=(0.78, 0.81, 0.86, 0.64),
        accent=(1.0, 0.69, 0.30, 1.0),
        good=(0.24, 0.80, 0.72, 1.0),
        wait=(1.0, 0.82, 0.36, 1.0),
        bad=(1.0, 0.44, 0.35, 1.0),
        glass=(0.05, 0.06, 0.085, 0.72),
        panel=(0.082, 0.092, 0.115, 1.0),
        raised=(0.125, 0.139, 0.170, 1.0),
        pressed=(0.19, 0.21, 0.255, 1.0),
        dark=(0.055, 0.062, 0.078, 1.0),
        popup=(0.10, 0.112, 0.138, 0.99),
        dimmed=(0.0, 0.0, 0.0, 0.5),
        line=(1.0, 1.0, 1.0, 0.09),
        track=(1.0, 1.0, 1.0, 0.20),
        stroke=(1.0, 0.80, 0.36, 1.0),
        cut=(1.0, 0.42, 0.36, 1.0),
        chain=(0.36, 0.92, 0.86, 1.0),
        mark=(1.0, 1.0, 1.0, 1.0),
        shadow=(0.0, 0.0, 0.0, 1.0),
        bone=(226, 232, 242),
        faded=(138, 150, 172),
        chosen=(255, 176, 76),
        hovered=(255, 226, 160),
        chained=(92, 232, 220),
        root=(255, 120, 96),
        axes=((236, 92, 84), (128, 206, 92), (92, 146, 246)),
        held_axis=(255, 226, 160),
        warning=(255, 74, 58),
        ghost=(150, 226, 255),
        before=(96, 160, 255),
        after=(255, 156, 72),
        glance_far=(13, 15, 20),
        glance_near=(168, 186, 209),
    ),
    "light": Theme(
        look="bright",
        ink=(0.07, 0.08, 0.11, 0.96),
        quiet=(0.19, 0.21, 0.26, 0.88),
        faint=(0.19, 0.21, 0.26, 0.74),
        accent=(0.54, 0.255, 0.0, 1.0),
        good=(0.0, 0.38, 0.34, 1.0),
        wait=(0.45, 0.31, 0.0, 1.0),
        bad=(0.70, 0.11, 0.05, 1.0),
        glass=(0.98, 0.985, 0.99, 0.80),
        panel=(0.945, 0.95, 0.96, 1.0),
        raised=(0.87, 0.88, 0.90, 1.0),
        pressed=(0.78, 0.80, 0.84, 1.0),
        dark=(0.895, 0.903, 0.92, 1.0),
        popup=(0.985, 0.988, 0.992, 0.99),
        dimmed=(0.18, 0.20, 0.25, 0.45),
        line=(0.0, 0.0, 0.0, 0.14),
        track=(0.0, 0.0, 0.0, 0.22),
        stroke=(0.70, 0.34, 0.0, 1.0),
        cut=(0.78, 0.10, 0.06, 1.0),
        chain=(0.0, 0.38, 0.42, 1.0),
        mark=(0.10, 0.11, 0.14, 1.0),
        shadow=(1.0, 1.0, 1.0, 1.0),
        bone=(64, 72, 92),
        faded=(122, 132, 152),
        chosen=(196, 92, 0),
        hovered=(226, 140, 30),
        chained=(0, 124, 130),
        root=(200, 44, 26),
        axes=((204, 44, 36), (46, 132, 24), (34, 88, 214)),
        held_axis=(222, 120, 0),
        warning=(226, 30, 18),
        ghost=(12, 104, 168),
        before=(28, 88, 210),
        after=(208, 90, 0),
        glance_far=(226, 229, 234),
        glance_near=(104, 122, 146),
    ),
}
"""Dark theme: translucent panels with amber accents over a dark stage. Light theme: light panels with umber
accents in a bright room.
"""


@dataclass(frozen=True)
class ColourSet:
    """The palette that distinguishes limbs, performers, takes, control points and characters.

    Attributes:
        limbs: the performer's limbs by number: head, arms, legs, trunk; left before right.
        performers: the performers by number.
        lanes: bars of the timeline, one colour per take.
        points: control points by number, on the stage, in lists, and on the paired joints.
        characters: meshes without colours. A character's name determines its colour.
        contact: a foot on the floor, on the timeline; ``flight``: both feet in the air.
    """

    limbs: tuple[Rgb, ...]
    performers: tuple[Rgb, ...]
    lanes: tuple[Rgb, ...]
    points: tuple[Rgb, ...]
    characters: tuple[Rgb, ...]
    contact: Rgb
    flight: Rgb


class _ColourBlindPalette:
    """The colours of Okabe and Ito, in addition to a grey."""

    orange, sky, green, yellow = (230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66)
    blue, vermilion, purple, grey = (0, 114, 178), (213, 94, 0), (204, 121, 167), (220, 220, 220)


COLOUR_SETS: dict[ColourSetName, ColourSet] = {
    "usual": ColourSet(
        limbs=(
            (51, 219, 214),
            (255, 168, 51),
            (184, 133, 255),
            (122, 235, 92),
            (255, 115, 140),
            (242, 230, 102),
        ),
        performers=((96, 226, 222), (255, 196, 92), (196, 160, 255), (150, 235, 130)),
        lanes=(
            (237, 153, 84),
            (92, 184, 199),
            (153, 189, 107),
            (204, 128, 158),
            (158, 148, 214),
            (212, 184, 107),
        ),
        points=(
            (255, 196, 84),
            (92, 200, 250),
            (150, 220, 110),
            (250, 130, 170),
            (180, 150, 255),
            (90, 226, 206),
            (255, 150, 90),
            (214, 222, 120),
        ),
        characters=(
            (226, 142, 84),
            (118, 164, 190),
            (150, 176, 120),
            (206, 128, 138),
            (196, 170, 110),
            (142, 138, 190),
        ),
        contact=(117, 178, 128),
        flight=(117, 148, 219),
    ),
    "okabe-ito": ColourSet(
        limbs=(
            _ColourBlindPalette.sky,
            _ColourBlindPalette.orange,
            _ColourBlindPalette.green,
            _ColourBlindPalette.yellow,
            _ColourBlindPalette.purple,
            _ColourBlindPalette.vermilion,
        ),
        performers=(
            _ColourBlindPalette.sky,
            _ColourBlindPalette.yellow,
            _ColourBlindPalette.purple,
            _ColourBlindPalette.vermilion,
        ),
        lanes=(
            _ColourBlindPalette.orange,
            _ColourBlindPalette.sky,
            _ColourBlindPalette.vermilion,
            _ColourBlindPalette.purple,
            _ColourBlindPalette.yellow,
            _ColourBlindPalette.green,
        ),
        points=(
            _ColourBlindPalette.orange,
            _ColourBlindPalette.sky,
            _ColourBlindPalette.grey,
            _ColourBlindPalette.blue,
            _ColourBlindPalette.vermilion,
            _ColourBlindPalette.purple,
            _ColourBlindPalette.yellow,
            _ColourBlindPalette.green,
        ),
        characters=(
            _ColourBlindPalette.orange,
            _ColourBlindPalette.sky,
            _ColourBlindPalette.vermilion,
            _ColourBlindPalette.purple,
            _ColourBlindPalette.yellow,
            _ColourBlindPalette.green,
        ),
        contact=_ColourBlindPalette.yellow,
        flight=_ColourBlindPalette.sky,
    ),
}
"""The usual palette, and the palette of M. Okabe and K. Ito, "Color Universal Design" (2008). People with any
kind of colour vision can distinguish the colours of the latter. The order maximises the difference between
adjacent colours (a test checks this).
"""


class _ActiveTheme:
    """The theme and the palette in use, which every colour reads."""

    theme: ThemeName = "dark"
    colours: ColourSetName = "usual"


class _ThemeColour(Sequence[Any]):
    """A named colour, or a named list of colours. The values are looked up in the current theme at each use.

    Args:
        name: name of an attribute of :class:`Theme` or :class:`ColourSet`.
        as_light: number of channels after the conversion from 0..255 to 0..1: 3, or 4 to add an opacity of 1.
            0 for no conversion.
    """

    def __init__(self, name: str, *, as_light: int = 0) -> None:
        self.name, self._as_light = name, as_light
        self._is_set = name in ColourSet.__dataclass_fields__

    @property
    def _values(self) -> Sequence[Any]:
        source = COLOUR_SETS[_ActiveTheme.colours] if self._is_set else THEMES[_ActiveTheme.theme]
        value: Sequence[Any] = getattr(source, self.name)
        if not self._as_light:
            return value
        is_sequence = isinstance(value[0], tuple)
        shares = [tuple(part / 255 for part in colour) for colour in (value if is_sequence else (value,))]
        shares = [(*fraction, 1.0)[: self._as_light] for fraction in shares]
        return shares if is_sequence else shares[0]

    def __getitem__(self, at: Any) -> Any:
        return self._values[at]

    def __len__(self) -> int:
        return len(self._values)


INK: Colour = _ThemeColour("ink")
"""Text."""
QUIET: Colour = _ThemeColour("quiet")
"""Secondary text."""
FAINT: Colour = _ThemeColour("faint")
"""Text of unavailable actions, and bones that the performer does not drive."""
ACCENT: Colour = _ThemeColour("accent")
"""Active or live objects: amber, or umber on light panels."""
GOOD: Colour = _ThemeColour("good")
"""Bluish green: no problem. People with red-green colour blindness can distinguish it from WAIT and BAD."""
WAIT: Colour = _ThemeColour("wait")
"""Yellow: a warning, or waiting."""
BAD: Colour = _ThemeColour("bad")
"""Vermilion: an error."""
GLASS: Colour = _ThemeColour("glass")
"""Translucent panels over the view: the stage is visible through them, and text stays readable."""

PANEL: Colour = _ThemeColour("panel")
"""Panels: less prominent than the stage, so that the work draws the attention."""
RAISED: Colour = _ThemeColour("raised")
"""Buttons, fields and boxes on a panel."""
PRESSED: Colour = _ThemeColour("pressed")
"""A button or field under the pointer or pressed."""
DARK: Colour = _ThemeColour("dark")
"""Views and timeline rows within a panel. They are darker than the panel."""
POPUP: Colour = _ThemeColour("popup")
"""Menus, dialogues and tooltips."""
DIMMED: Colour = _ThemeColour("dimmed")
"""Overlay that dims the window behind a dialogue."""
LINE: Colour = _ThemeColour("line")
"""Separators between parts: barely visible."""
TRACK: Colour = _ThemeColour("track")
"""The part of the timeline that has not been played yet."""
STROKE: Colour = _ThemeColour("stroke")
"""A stroke being sketched."""
CUT: Colour = _ThemeColour("cut")
"""A cutting stroke, and the places that it cuts."""
CHAIN: Colour = _ThemeColour("chain")
"""A chain of joints, in overlays and lists."""
MARK: Colour = _ThemeColour("mark")
"""Rings and outlines over the view: maximum contrast to the stage."""
SHADOW: Colour = _ThemeColour("shadow")
"""Background of marks and labels that are drawn directly on the view: the opposite of MARK."""
ON_COLOUR: Colour = (0.055, 0.062, 0.078, 1.0)
"""Text on bars and buttons in palette colours, which are bright in both themes."""
ON_FILL: Colour = _ThemeColour("dark")
"""Text on buttons and bars that are filled with ACCENT, GOOD, WAIT or BAD."""
UNTINTED: Colour = (1.0, 1.0, 1.0, 1.0)
"""Tint that leaves images unchanged."""
CLEAR: Colour = (0.0, 0.0, 0.0, 0.0)
"""Fully transparent."""

SELECTED_BONE: Paint = _ThemeColour("bone")
"""Bones of the selected shape."""
UNSELECTED_BONE: Paint = _ThemeColour("faded")
"""Bones of other shapes: dimmer."""
SELECTED_JOINT: Paint = _ThemeColour("chosen")
"""The selected joint: the colour of active objects."""
HOVERED_JOINT: Paint = _ThemeColour("hovered")
"""The joint under the pointer: between the colours of other joints and of the selected joint."""
CHAINED_BONE: Paint = _ThemeColour("chained")
"""A chain of joints, as in overlays."""
ROOT_JOINT: Paint = _ThemeColour("root")
"""The root joint, which moves the whole shape."""
AXIS_COLOURS: Sequence[Paint] = _ThemeColour("axes")
"""The x, y and z axes of the gizmo: red, green and blue, as in every 3D program."""
HELD_AXIS: Paint = _ThemeColour("held_axis")
"""The part of the gizmo under the pointer."""
WARNING: Paint = _ThemeColour("warning")
"""Self-intersecting faces."""
GHOST: Paint = _ThemeColour("ghost")
"""The outline of the previous key pose."""
PAST_POSE: Paint = _ThemeColour("before")
"""Past poses of a character: blue, distinct from FUTURE_POSE even with red-green colour blindness."""
FUTURE_POSE: Paint = _ThemeColour("after")
"""Future poses of a character: orange."""
DEPTH_FAR: Paint = _ThemeColour("glance_far")
"""Far or unknown pixels of a depth image: similar to the background of panels."""
DEPTH_NEAR: Paint = _ThemeColour("glance_near")
"""The nearest pixels of a depth image: distinct from the colour of a performer's skeleton."""
PLAIN_SURFACE: Paint = (205, 208, 214)
"""A mesh without colours while it is painted or scanned. It is light, so that every paint
colour is visible.
"""

LIMB_COLOURS: Sequence[Sequence[float]] = _ThemeColour("limbs", as_light=3)
"""sRGB 0..1 of the performer's limbs by number."""
PERFORMER_COLOURS: Sequence[Paint] = _ThemeColour("performers")
"""sRGB of performers by number."""
LANE_COLOURS: Sequence[Colour] = _ThemeColour("lanes", as_light=4)
"""Bars of the timeline, one colour per take."""
POINT_COLOURS: Sequence[Paint] = _ThemeColour("points")
"""sRGB of control points by number."""
DEFAULT_COLOURS: Sequence[Paint] = _ThemeColour("characters")
"""sRGB of meshes without colours."""
CONTACT: Colour = _ThemeColour("contact", as_light=4)
"""Bars of the timeline: a foot on the floor."""
FLIGHT: Colour = _ThemeColour("flight", as_light=4)
"""Bars of the timeline: both feet in the air."""


def use_theme(name: str, colours: str) -> None:
    """Switches to a theme and a palette. An unknown name selects the first theme or palette."""
    _ActiveTheme.theme = next((theme for theme in THEMES if theme == name), "dark")
    _ActiveTheme.colours = next((palette for palette in COLOUR_SETS if palette == colours), "usual")


def get_theme() -> tuple[ThemeName, ColourSetName]:
    """Returns the names of the theme and of the palette in use."""
    return _ActiveTheme.theme, _ActiveTheme.colours


def is_light() -> bool:
    """Returns True if the current theme has dark text on light panels."""
    return THEMES[_ActiveTheme.theme].look == "bright"


def look_in_theme(look: Look) -> Look:
    """Returns the preset of light and backdrop with which the window shows a stage. In the light theme,
    "studio" becomes "bright".
    """
    return THEMES[_ActiveTheme.theme].look if look == "studio" else look


def get_performer_colour(number: int) -> Colour:
    """Returns the colour of a performer, by the performer's position among those present."""
    red, green, blue = PERFORMER_COLOURS[number % len(PERFORMER_COLOURS)]
    return red / 255, green / 255, blue / 255, 1.0


def get_point_colour(number: int) -> Paint:
    """Returns the sRGB of a control point, by its number on the puppet."""
    point: Paint = POINT_COLOURS[number % len(POINT_COLOURS)]
    return point
