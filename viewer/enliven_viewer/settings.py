"""Every number of the viewer that a user may want to change."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from typing import Literal

from enliven.errors import InputError
from enliven.settings import setting

Encoder = Literal[
    "auto", "libx264", "libopenh264", "h264_videotoolbox", "h264_mf", "libvpx-vp9", "mpeg4"
]  # from enliven.film.encoders
SkeletonShown = Literal["choosing", "always", "never"]
LookName = Literal["studio", "bright", "night", "white", "dawn", "garden"]


@dataclass(frozen=True)
class RenderSettings:
    """Settings of the rendered image."""

    samples: int = setting(4, "Samples a pixel for smooth edges; 1 turns it off.", low=1, high=16)
    shadow_size: int = setting(384, "Side of the shadow map.", unit="pixels", low=64, high=4096)
    contact_size: int = setting(
        160, "Side of the map of what is near the floor.", unit="pixels", low=32, high=1024
    )
    crease_angle: float = setting(
        45.0, "Edges sharper than this look crisp.", unit="degrees", low=0, high=180
    )
    field_of_view: float = setting(34.0, "Vertical opening of the camera.", unit="degrees", low=5, high=120)
    reveal_distance: float = setting(
        0.10, "Closer to the body's surface than this, the mesh is transparent.", unit="metres", low=0, high=2
    )
    reveal_opacity: float = setting(0.16, "Opacity of the mesh where the body is inside it.", low=0, high=1)
    look: LookName = setting("studio", "Light, backdrop and floor.")
    grid: bool = setting(True, "Lines on the floor, half a metre apart, where the look has them.")
    backdrop: str = setting("", "Colour of the backdrop, such as '#22334a'; empty: the look's own.")
    brightness: float = setting(1.0, "All light, times this.", low=0.1, high=10)
    light_around: float = setting(
        37.4,
        "Where the key light comes from: 0 is the front, 90 the right.",
        unit="degrees",
        low=-180,
        high=180,
    )
    light_up: float = setting(
        55.3, "How high the key light is above the horizon.", unit="degrees", low=15, high=90
    )
    skeleton: SkeletonShown = setting(
        "choosing",
        "When performers' skeletons are seen in the mesh: while they choose what to hold, or ever.",
    )
    held_light: float = setting(1.0, "Light on the parts of a mesh that are held.", low=0, high=2)
    texture_size: int = setting(2048, "Larger textures are made smaller.", unit="pixels", low=16, high=16384)
    anisotropy: int = setting(4, "Sharpness of textures seen at a slant; 1 is least.", low=1, high=16)

    def __post_init__(self) -> None:
        if self.backdrop and not re.fullmatch(r"#[0-9a-fA-F]{6}", self.backdrop):
            mend = "Give six hexadecimal digits, such as '#22334a'."
            raise InputError(f"{self.backdrop!r} is no colour", where="render.backdrop", mend=mend)

    @property
    def opening(self) -> float:
        """Returns the vertical field of view of the camera in radians."""
        return math.radians(self.field_of_view)


@dataclass(frozen=True)
class PlaybackSettings:
    """Settings of the viewer's memory of received data."""

    minutes: float = setting(10.0, "Length of the live timeline.", unit="minutes", low=0.1, high=240)
    rate: float = setting(
        30.0, "Expected poses a second, which bounds the memory.", unit="Hz", low=1, high=1000
    )
    gap: float = setting(
        0.2, "Poses further apart than this are not blended.", unit="seconds", low=0, high=60
    )
    restart: float = setting(
        1.0, "A sensor clock that jumps back by more than this starts a new timeline.", unit="seconds", low=0
    )


@dataclass(frozen=True)
class FilmSettings:
    """Settings of films."""

    rate: float = setting(30.0, "Frames a second of sensor time.", unit="Hz", low=1, high=240)
    bit_rate: float = setting(6.0, "Bit rate of the film.", unit="Mbit/s", low=0.1, high=200)
    encoder: Encoder = setting("auto", "Which encoder makes the film; auto: the first that works here.")
    overlay_seconds: float = setting(
        5.0,
        "Seconds that body and attachments stay visible after possession.",
        unit="seconds",
        low=0,
        high=3600,
    )
    columns: int = setting(4, "Tiles in a row of the contact sheet.", low=1, high=20)
    rows: int = setting(3, "Rows of the contact sheet.", low=1, high=20)
    tile_width: int = setting(
        480, "Width of one tile of the contact sheet.", unit="pixels", low=32, high=4096
    )
    patience: float = setting(
        20.0, "Seconds to wait for an edge to appear.", unit="seconds", low=0, high=3600
    )


@dataclass(frozen=True)
class ViewerSettings:
    """All settings of the viewer, in groups."""

    render: RenderSettings = field(default_factory=RenderSettings)
    playback: PlaybackSettings = field(default_factory=PlaybackSettings)
    film: FilmSettings = field(default_factory=FilmSettings)
    width: int = setting(1280, "Width of the window or film.", unit="pixels", low=16, high=16384)
    height: int = setting(720, "Height of the window or film.", unit="pixels", low=16, high=16384)


@dataclass(frozen=True)
class WindowStart:
    """How the window starts.

    Attributes:
        title: title of the window.
        bare: whether there is no text over the image and no panel.
        full_screen: whether it fills the monitor.
        escape_ends: whether Escape closes the window if it has nothing else to cancel.
        audience: whether menus, numbers and shortcuts are hidden while it fills the monitor.
    """

    title: str = "enliven"
    bare: bool = False
    full_screen: bool = False
    escape_ends: bool = False
    audience: bool = False


def sized(settings: ViewerSettings, size: str | None) -> ViewerSettings:
    """Returns the settings with a size such as "1280x720".

    Raises:
        InputError: if the size is invalid.
    """
    if size is None:
        return settings
    found = re.fullmatch(r"(\d{2,5})\s*[x×]\s*(\d{2,5})", size.strip().lower())
    if not found or not all(16 <= int(n) <= 16384 for n in found.groups()):
        raise InputError(f"{size!r} is no size", where="--size", mend="Give WIDTHxHEIGHT, such as 1280x720.")
    return replace(settings, width=int(found[1]), height=int(found[2]))
