"""The typeface and all colours of the window and the studio: two themes, and two sets of telling colours.

A colour is a name such as ``INK``, which reads as the numbers of the theme in use: :func:`use_theme` changes
every colour at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

FONT = "fonts/Roboto/Roboto-Regular.ttf"
"""The typeface, as ImGui's bundle brings it."""

Colour = Sequence[float]
"""sRGB and opacity, 0..1 each."""
Paint = Sequence[int]
"""sRGB, 0..255 each, of something in the 3-D picture."""
Four = tuple[float, float, float, float]
Three = tuple[int, int, int]
ThemeName = Literal["dark", "light"]
ColourSetName = Literal["usual", "okabe-ito"]
Look = Literal["studio", "bright", "night", "white", "dawn", "garden"]


@dataclass(frozen=True)
class Theme:
    """The colours of a theme; the names below the class say what each is for.

    Attributes:
        look: how the window shows the look "studio" of the stage.
    """

    look: Literal["studio", "bright"]
    ink: Four
    quiet: Four
    faint: Four
    accent: Four
    good: Four
    wait: Four
    bad: Four
    glass: Four
    panel: Four
    raised: Four
    pressed: Four
    dark: Four
    popup: Four
    dimmed: Four
    line: Four
    track: Four
    stroke: Four
    cut: Four
    chain: Four
    mark: Four
    shadow: Four
    bone: Three
    faded: Three
    chosen: Three
    hovered: Three
    chained: Three
    root: Three
    axes: tuple[Three, Three, Three]
    held_axis: Three
    warning: Three
    ghost: Three
    before: Three
    after: Three
    glance_far: Three
    glance_near: Three


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
"""Glass and amber on the renderer's dusk; and paper and umber in a bright room."""


@dataclass(frozen=True)
class ColourSet:
    """Colours that tell limbs, performers, takes, control points and characters from one another.

    Attributes:
        limbs: of the performer's limbs, by their numbers: head, arms, legs, trunk; left before right.
        performers: of performers in the order of their numbers.
        lanes: bars of the timeline, a colour a take.
        points: control points, in turn: on the stage, in lists, and of the joints they are paired with.
        characters: meshes that bring no colours; which one follows from the character's name.
        contact: a foot on the floor, on the timeline; ``flight``: both feet in the air.
    """

    limbs: tuple[Three, ...]
    performers: tuple[Three, ...]
    lanes: tuple[Three, ...]
    points: tuple[Three, ...]
    characters: tuple[Three, ...]
    contact: Three
    flight: Three


class _Safe:
    """The colours of Okabe and Ito, and a grey."""

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
        limbs=(_Safe.sky, _Safe.orange, _Safe.green, _Safe.yellow, _Safe.purple, _Safe.vermilion),
        performers=(_Safe.sky, _Safe.yellow, _Safe.purple, _Safe.vermilion),
        lanes=(_Safe.orange, _Safe.sky, _Safe.vermilion, _Safe.purple, _Safe.yellow, _Safe.green),
        points=(
            _Safe.orange,
            _Safe.sky,
            _Safe.grey,
            _Safe.blue,
            _Safe.vermilion,
            _Safe.purple,
            _Safe.yellow,
            _Safe.green,
        ),
        characters=(_Safe.orange, _Safe.sky, _Safe.vermilion, _Safe.purple, _Safe.yellow, _Safe.green),
        contact=_Safe.yellow,
        flight=_Safe.sky,
    ),
}
"""The usual colours; and those of M. Okabe and K. Ito, "Color Universal Design" (2008), which people with any
kind of colour vision tell apart. They stand in the order in which neighbours differ most (see the test)."""


class _InUse:
    """The theme and the set of colours in use, which every colour reads."""

    theme: ThemeName = "dark"
    colours: ColourSetName = "usual"


class _Shown(Sequence[Any]):
    """A colour, or some colours, by name: reads as the numbers of the theme in use.

    Args:
        name: of an attribute of :class:`Theme` or :class:`ColourSet`.
        as_light: 255 whole steps of sRGB read as 0..1; colours of four numbers get an opacity of 1.
    """

    def __init__(self, name: str, *, as_light: int = 0) -> None:
        self.name, self._as_light = name, as_light
        self._is_set = name in ColourSet.__dataclass_fields__

    @property
    def _now(self) -> Sequence[Any]:
        source = COLOUR_SETS[_InUse.colours] if self._is_set else THEMES[_InUse.theme]
        value: Sequence[Any] = getattr(source, self.name)
        if not self._as_light:
            return value
        many = isinstance(value[0], tuple)
        shares = [tuple(part / 255 for part in one) for one in (value if many else (value,))]
        shares = [(*one, 1.0)[: self._as_light] for one in shares]
        return shares if many else shares[0]

    def __getitem__(self, at: Any) -> Any:
        return self._now[at]

    def __len__(self) -> int:
        return len(self._now)


INK: Colour = _Shown("ink")
"""Text."""
QUIET: Colour = _Shown("quiet")
"""Text of less weight."""
FAINT: Colour = _Shown("faint")
"""Text of actions that cannot be done now, and bones that no limb of the performer drives."""
ACCENT: Colour = _Shown("accent")
"""Active or live things: amber, or umber on light panels."""
GOOD: Colour = _Shown("good")
"""Bluish green: all is well. Eyes that mix up red and green still tell it from the next two."""
WAIT: Colour = _Shown("wait")
"""Yellow: a warning, or something that is waited for."""
BAD: Colour = _Shown("bad")
"""Vermilion: an error."""
GLASS: Colour = _Shown("glass")
"""Panels over the picture: the stage shows through, and text stays easy to read."""

PANEL: Colour = _Shown("panel")
"""Panels: quieter than the stage, so that the work catches the eye."""
RAISED: Colour = _Shown("raised")
"""Buttons, fields and boxes on a panel."""
PRESSED: Colour = _Shown("pressed")
"""A button or field under the pointer or pressed."""
DARK: Colour = _Shown("dark")
"""Views and lanes within a panel: deeper than the panel."""
POPUP: Colour = _Shown("popup")
"""Menus, dialogues and tooltips."""
DIMMED: Colour = _Shown("dimmed")
"""The window behind a dialogue is covered by it."""
LINE: Colour = _Shown("line")
"""Lines between parts: barely seen."""
TRACK: Colour = _Shown("track")
"""The part of the timeline that was not played yet."""
STROKE: Colour = _Shown("stroke")
"""A stroke that is being sketched."""
CUT: Colour = _Shown("cut")
"""A stroke that cuts, and the places where it does."""
CHAIN: Colour = _Shown("chain")
"""A chain of joints, in overlays and lists."""
MARK: Colour = _Shown("mark")
"""Rings and outlines over the picture: as far from the stage's brightness as can be."""
SHADOW: Colour = _Shown("shadow")
"""Behind marks and words that lie on the picture itself: the opposite of MARK."""
ON_COLOUR: Colour = (0.055, 0.062, 0.078, 1.0)
"""Text on bars and buttons of the colour sets, which are bright in both themes."""
ON_FILL: Colour = _Shown("dark")
"""Text on buttons and bars that are filled with ACCENT, GOOD, WAIT or BAD: dark on bright, light on deep."""
UNTINTED: Colour = (1.0, 1.0, 1.0, 1.0)
"""Pictures are drawn times this: unchanged."""
CLEAR: Colour = (0.0, 0.0, 0.0, 0.0)
"""Nothing is drawn."""

BONE: Paint = _Shown("bone")
"""Bones of the selected shape."""
FADED: Paint = _Shown("faded")
"""Bones of other shapes: dimmer."""
CHOSEN: Paint = _Shown("chosen")
"""The chosen joint: as whatever is active."""
HOVERED: Paint = _Shown("hovered")
"""The joint under the pointer: between plain and chosen."""
CHAINED: Paint = _Shown("chained")
"""A chain of joints: as in overlays."""
ROOT: Paint = _Shown("root")
"""The root joint, which moves the whole shape."""
AXES: Sequence[Paint] = _Shown("axes")
"""The manipulator's x, y and z: red, green, blue, as every 3-D program has them."""
HELD_AXIS: Paint = _Shown("held_axis")
"""The part of the manipulator under the pointer."""
WARNING: Paint = _Shown("warning")
"""Faces that pass through one another."""
GHOST: Paint = _Shown("ghost")
"""The outline of the key pose before."""
BEFORE: Paint = _Shown("before")
"""Where a character was: blue, which eyes that mix up red and green tell from the next."""
AFTER: Paint = _Shown("after")
"""Where a character will be: orange."""
GLANCE_FAR: Paint = _Shown("glance_far")
"""The far or unknown part of a depth picture: like the ground of panels."""
GLANCE_NEAR: Paint = _Shown("glance_near")
"""The nearest part of a depth picture: it differs from the colour of a performer's skeleton."""
PLAIN_SURFACE: Paint = (205, 208, 214)
"""A mesh without colours while it is painted or scanned: so light that every paint is seen on it."""

LIMBS: Sequence[Sequence[float]] = _Shown("limbs", as_light=3)
"""sRGB 0..1 of the performer's limbs, by their numbers."""
PERFORMERS: Sequence[Paint] = _Shown("performers")
"""sRGB of performers, in the order of their numbers."""
LANES: Sequence[Colour] = _Shown("lanes", as_light=4)
"""Bars of the timeline, a colour a take."""
POINTS: Sequence[Paint] = _Shown("points")
"""sRGB of control points, in turn."""
DEFAULT_COLOURS: Sequence[Paint] = _Shown("characters")
"""sRGB of meshes that bring no colours."""
CONTACT: Colour = _Shown("contact", as_light=4)
"""Bars of the timeline: a foot on the floor."""
FLIGHT: Colour = _Shown("flight", as_light=4)
"""Bars of the timeline: both feet in the air."""


def use_theme(name: str, colours: str) -> None:
    """Gives every colour the numbers of a theme and a set; an unknown name is the first of its kind."""
    _InUse.theme = next((one for one in THEMES if one == name), "dark")
    _InUse.colours = next((one for one in COLOUR_SETS if one == colours), "usual")


def theme_in_use() -> tuple[ThemeName, ColourSetName]:
    """Returns the names of the theme and of the set of colours that are in use."""
    return _InUse.theme, _InUse.colours


def is_light() -> bool:
    """Returns whether the theme in use has dark letters on light panels."""
    return THEMES[_InUse.theme].look == "bright"


def look_in_theme(look: Look) -> Look:
    """Returns the look in which the window shows a stage: the usual one is bright in a light theme."""
    return THEMES[_InUse.theme].look if look == "studio" else look


def performer_colour(number: int) -> Colour:
    """Returns the colour of a performer, by its place among those who are present."""
    red, green, blue = PERFORMERS[number % len(PERFORMERS)]
    return red / 255, green / 255, blue / 255, 1.0


def point_colour(number: int) -> Paint:
    """Returns the sRGB of a control point, by its number on the puppet."""
    point: Paint = POINTS[number % len(POINTS)]
    return point
