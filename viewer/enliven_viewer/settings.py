"""The settings of the viewer that a user may change."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

from enliven.errors import InputError
from enliven.outputs.settings import LiveOutputSettings
from enliven.settings import parameter, setting

Encoder = Literal[
    "auto", "libx264", "libopenh264", "h264_videotoolbox", "h264_mf", "libvpx-vp9", "mpeg4"
]  # Keep this list equal to the encoders in enliven.film.encoders.
SkeletonShown = Literal["choosing", "always", "never"]
LookName = Literal["studio", "bright", "night", "white", "dawn", "garden"]


@dataclass(frozen=True)
class RenderSettings:
    """Settings of the rendered image."""

    REMOVED_SETTINGS: ClassVar = ("crease_angle", "reveal_distance", "anisotropy")

    samples: int = setting(
        4,
        "Number of samples per pixel for anti-aliasing. 1 turns it off. Use fewer on slow graphics cards.",
        low=1,
        high=16,
    )
    shadow_size: int = setting(
        384,
        "Side length of the shadow map. Larger shadows are sharper but slower.",
        unit="pixels",
        low=64,
        high=4096,
    )
    contact_size: int = parameter(
        160,
        "Side length of the contact shadow map, which darkens the floor near objects.",
        unit="pixels",
        low=32,
        high=1024,
    )
    field_of_view: float = setting(
        34.0, "Vertical field of view of the camera.", unit="degrees", low=5, high=120
    )
    reveal_opacity: float = setting(
        0.16,
        "Opacity of a mesh while the performer's body inside it is shown.",
        low=0,
        high=1,
    )
    look: LookName = setting("studio", "Preset of light, backdrop and floor.")
    grid: bool = setting(
        True, "Shows grid lines on the floor, half a metre apart, if the look contains grid lines."
    )
    backdrop: str = setting("", "Colour of the backdrop, such as '#22334a'. Empty: the colour of the look.")
    brightness: float = setting(1.0, "Factor on the brightness of all lights.", low=0.1, high=10)
    light_around: float = setting(
        37.4,
        "Horizontal direction of the key light: 0 is the front, 90 the right.",
        unit="degrees",
        low=-180,
        high=180,
    )
    light_up: float = setting(
        55.3, "Height of the key light above the horizon.", unit="degrees", low=15, high=90
    )
    skeleton: SkeletonShown = setting(
        "choosing",
        "When performers' skeletons are visible: while a performer chooses a limb, always, or never.",
    )
    held_light: float = setting(
        1.0, "Strength of the highlight on the parts of a mesh that a performer controls.", low=0, high=2
    )
    texture_size: int = setting(
        2048,
        "Maximum side length of a texture. Larger textures are reduced to save graphics memory.",
        unit="pixels",
        low=16,
        high=16384,
    )

    def __post_init__(self) -> None:
        if self.backdrop and not re.fullmatch(r"#[0-9a-fA-F]{6}", self.backdrop):
            remedy = "Write # and six hexadecimal digits, such as '#22334a'."
            raise InputError(f"{self.backdrop!r} is not a colour", where="render.backdrop", remedy=remedy)

    @property
    def opening(self) -> float:
        """Returns the vertical field of view of the camera in radians."""
        return math.radians(self.field_of_view)


@dataclass(frozen=True)
class PlaybackSettings:
    """Settings of the viewer's memory of received data."""

    REMOVED_SETTINGS: ClassVar = ("restart",)

    minutes: float = setting(
        10.0, "Length of the live timeline. Older poses are deleted.", unit="minutes", low=0.1, high=240
    )
    rate: float = parameter(
        30.0,
        "Expected number of poses per second. This value limits the memory of the live timeline.",
        unit="Hz",
        low=1,
        high=1000,
    )
    gap: float = parameter(
        0.2, "Longest gap between two poses that is filled by interpolation.", unit="seconds", low=0, high=60
    )


@dataclass(frozen=True)
class FilmSettings:
    """Settings of films."""

    rate: float = setting(
        30.0, "Frame rate of the film, in frames per second of sensor time.", unit="Hz", low=1, high=240
    )
    bit_rate: float = setting(
        6.0,
        "Bit rate of the film. Raise it for better quality and a larger file.",
        unit="Mbit/s",
        low=0.1,
        high=200,
    )
    encoder: Encoder = setting(
        "auto", "Video encoder of the film. 'auto' uses the first that works on this computer."
    )
    overlay_seconds: float = setting(
        5.0,
        "Time for which skeleton and attachment points stay visible after a character is possessed.",
        unit="seconds",
        low=0,
        high=3600,
    )
    columns: int = setting(4, "Number of images per row of the contact sheet.", low=1, high=20)
    rows: int = setting(3, "Number of rows of the contact sheet.", low=1, high=20)
    tile_width: int = parameter(
        480, "Width of one image of the contact sheet.", unit="pixels", low=32, high=4096
    )
    patience: float = parameter(
        20.0, "Maximum time to wait for an edge on the network.", unit="seconds", low=0, high=3600
    )


@dataclass(frozen=True)
class ViewerSettings:
    """All settings of the viewer, in groups."""

    render: RenderSettings = field(default_factory=RenderSettings)
    playback: PlaybackSettings = field(default_factory=PlaybackSettings)
    film: FilmSettings = field(default_factory=FilmSettings)
    width: int = setting(1280, "Width of the window or film.", unit="pixels", low=16, high=16384)
    height: int = setting(720, "Height of the window or film.", unit="pixels", low=16, high=16384)
    space: str = setting(
        "", "Path of a space file of `enliven calibrate` that places several edges, relative to this file."
    )
    outputs: dict[str, LiveOutputSettings] = field(
        default_factory=dict, metadata={"doc": "Other programs that receive the shown motion live, by name."}
    )


@dataclass(frozen=True)
class WindowStart:
    """How the window starts.

    Attributes:
        title: title of the window.
        bare: True to show no text over the image and no panel.
        full_screen: whether it fills the monitor.
        escape_ends: True if Escape closes the window when there is nothing else to cancel.
        audience: True to hide menus, numbers and shortcuts while the window fills the monitor.
    """

    title: str = "enliven"
    bare: bool = False
    full_screen: bool = False
    escape_ends: bool = False
    audience: bool = False


def with_size(settings: ViewerSettings, size: str | None) -> ViewerSettings:
    """Returns the settings with the width and height of a size such as "1280x720". None leaves them
    unchanged.

    Raises:
        InputError: if the size is invalid.
    """
    if size is None:
        return settings
    match = re.fullmatch(r"(\d{2,5})\s*[x×]\s*(\d{2,5})", size.strip().lower())
    if not match or not all(16 <= int(n) <= 16384 for n in match.groups()):
        raise InputError(
            f"{size!r} is not a size", where="--size", remedy="Write WIDTHxHEIGHT, such as 1280x720."
        )
    return replace(settings, width=int(match[1]), height=int(match[2]))
