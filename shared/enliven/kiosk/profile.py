"""The profile of a kiosk: one TOML file with its edges, characters, story, screen, health page and
maintenance.

All programs of a kiosk read the same file: ``enliven kiosk PROFILE``, its window, the health page and
``enliven install-kiosk``. Paths in a profile are relative to its folder.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from enliven.errors import InputError
from enliven.settings import group, load_settings, parameter, setting

MAX_SOUVENIR_AGE_S = 86_400.0
"""Maximum time for which a souvenir can be stored, in seconds (a day)."""


@dataclass(frozen=True)
class KioskEdge:
    """One edge of a kiosk: ``[edges.NAME]``. If an address is set, the edge runs on another computer."""

    settings: str = setting("", "Settings file of the edge (TOML). Empty: the defaults.")
    arguments: tuple[str, ...] = setting(
        (), "Additional command-line arguments of `enliven edge`, such as `--sensor`, `oak`."
    )
    address: str = setting(
        "",
        "Address of an edge on another computer, as HOST or HOST:PORT. Empty: the edge is "
        "started on this computer.",
    )
    port: int = setting(
        5580, "Network port of the edge's pose stream. Commands use the next port.", low=1, high=65534
    )


@dataclass(frozen=True)
class KioskCharacter:
    """One character that visitors can choose: ``[characters.NAME]``."""

    mesh: str = setting("chair", "Path of a mesh, session or project, or 'chair', 'lamp' or 'cactus'.")
    title: str = setting(
        "", "Name of the character on the screen. Empty: the name of its table in the profile."
    )
    parts: str = setting(
        "",
        "Body parts that possess the character, such as 'all' or 'legs'. Empty: chosen "
        "automatically for the mesh.",
    )
    drive: Literal["", "graph", "skeleton"] = setting(
        "", "Rig that moves the character. Empty: chosen automatically for the mesh."
    )


@dataclass(frozen=True)
class ZoneSettings:
    """The zone of the floor in which visitors are noticed, and the spot at which they possess a character."""

    center: tuple[float, float] = setting(
        (0.0, -2.5),
        "Center of the spot on the floor (x, z). A camera at the origin looks along -z.",
        unit="m",
    )
    width: float = setting(3.0, "Width of the zone for detecting visitors.", unit="m", low=0.5, high=20.0)
    depth: float = setting(3.0, "Depth of the zone for detecting visitors.", unit="m", low=0.5, high=20.0)
    space: str = setting(
        "",
        "File with the positions of several edges, written by enliven calibrate. The zone is "
        "in the coordinate system of the first edge. Empty: all edges have the same "
        "coordinate system.",
    )
    spot: float = setting(
        0.5, "Radius of the spot at which a visitor possesses a character.", unit="m", low=0.2, high=3.0
    )


@dataclass(frozen=True)
class StorySettings:
    """The actions of the kiosk for its visitors, and their durations."""

    attract: tuple[str, ...] = setting(
        (),
        "Recorded performances (.mcap) that are shown while nobody visits. Empty: the performances "
        "that come with enliven.",
    )
    dwell: float = setting(
        1.5,
        "Time that a visitor must stay on the spot to possess the character.",
        unit="s",
        low=0.3,
        high=10.0,
    )
    lost: float = setting(
        2.0, "Time without a visitor after which the farewell starts.", unit="s", low=0.2, high=30.0
    )
    session: float = setting(
        120.0,
        "Maximum time that a visitor possesses a character. 0: no limit.",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    farewell: float = setting(4.0, "Duration of the farewell.", unit="s", low=0.5, high=30.0)
    choose: Literal["", "step", "hand", "button"] = setting(
        "step",
        "How visitors choose another character: by a step to the side, a raised hand, or a "
        "button. Empty: never.",
    )
    performers: int = setting(
        1, "Maximum number of visitors that possess a character at the same time.", low=1, high=6
    )
    language: str = setting("", "Language of the texts on the screen. Empty: the language of the computer.")
    sound: bool = setting(
        False, "Plays a sound when a visitor is noticed, possesses a character or releases the character."
    )


@dataclass(frozen=True)
class ScreenSettings:
    """The screen of the kiosk."""

    number: int = setting(0, "Number of the monitor. The first monitor is 0.", low=0, high=15)
    size: str = setting("", "Size of the window, such as 1920x1080. Empty: the whole monitor.")
    turn: Literal[0, 90, 180, 270] = setting(
        0, "Rotation of the image, for a monitor in portrait orientation.", unit="degrees"
    )
    settings: str = setting(
        "", "Settings file of the viewer (TOML) for light, backdrop and floor. Empty: the defaults."
    )


@dataclass(frozen=True)
class SouvenirSettings:
    """Settings for souvenirs: a photo or film of each visitor's character, for the visitor's phone. Off by
    default.

    A souvenir shows the characters on the screen. It does not contain images of the camera.
    """

    kind: Literal["", "photo", "film"] = setting(
        "", "Souvenir of each session: a photo or a film. Empty: no souvenirs."
    )
    keep: float = setting(
        30.0,
        "Time after which a souvenir is deleted.",
        unit="minutes",
        low=1.0,
        high=MAX_SOUVENIR_AGE_S / 60.0,
    )
    space: float = setting(
        200.0,
        "Maximum total size of all souvenirs. Above this size, the oldest are deleted.",
        unit="MB",
        low=50.0,
        high=10000.0,
    )
    length: float = setting(6.0, "Maximum duration of a film.", unit="s", low=2.0, high=30.0)
    code: float = parameter(20.0, "Time for which the QR code is shown.", unit="s", low=5.0, high=120.0)
    host: str = setting(
        "127.0.0.1",
        "Network address at which phones get souvenirs, such as 0.0.0.0. Phones cannot reach 127.0.0.1.",
    )
    port: int = setting(5592, "Network port of the souvenir server.", low=1, high=65535)
    address: str = setting(
        "",
        "Start of the address in the QR code, such as http://kiosk.example:5592/. Empty: the "
        "network address of this computer.",
    )
    certificate: str = setting(
        "", "File with the TLS certificate (PEM). Empty: souvenirs are sent without encryption."
    )
    certificate_key: str = setting(
        "", "File with the key of the TLS certificate (PEM). Only its owner may have read permission."
    )


@dataclass(frozen=True)
class AlertSettings:
    """Settings for alerts, which inform operators about problems."""

    webhook: str = setting("", "Address (URL) that receives each alert as JSON. Empty: no webhook.")
    command: str = setting(
        "",
        "Command that is run for each alert. It receives the alert as JSON on its standard "
        "input. Empty: no command.",
    )
    quiet: float = setting(
        600.0, "Minimum time between two alerts about the same problem.", unit="s", low=10.0, high=86400.0
    )


@dataclass(frozen=True)
class HealthPageSettings:
    """The health page."""

    host: str = setting(
        "127.0.0.1",
        "Network address of the health page. An address that other computers can "
        "reach needs a password and TLS.",
    )
    port: int = setting(5590, "Network port of the health page.", low=1, high=65535)
    password_file: str = setting("", "File with the password. Only its owner may have read permission.")
    certificate: str = setting("", "File with the TLS certificate (PEM).")
    certificate_key: str = setting(
        "", "File with the key of the TLS certificate (PEM). Only its owner may have read permission."
    )


@dataclass(frozen=True)
class CareSettings:
    """Maintenance settings for a computer that runs for weeks."""

    restart_at: str = setting(
        "", "Time of day at which all programs are restarted, such as 04:00. Empty: never."
    )
    recordings: str = setting(
        "", "Folder for recordings of the visits (bodies and poses). Empty: visits are not recorded."
    )
    keep_free: float = setting(
        1.0,
        "Minimum free space on the disk. If less is free, the oldest recordings are deleted.",
        unit="GB",
        low=0.1,
        high=10000.0,
    )
    frozen_after: float = setting(
        10.0, "Time without progress after which a program is restarted.", unit="s", low=2.0, high=600.0
    )


@dataclass(frozen=True)
class KioskProfile:
    """All settings of a kiosk."""

    name: str = setting("kiosk", "Name of the kiosk. Operators see it on the health page and in alerts.")
    edges: dict[str, KioskEdge] = field(
        default_factory=dict,
        metadata={"doc": "The edges, by name. Without this table, one edge with the defaults is used."},
    )
    characters: dict[str, KioskCharacter] = field(
        default_factory=dict,
        metadata={"doc": "The characters, by name. Without this table, the chair is used."},
    )
    zone: ZoneSettings = group(ZoneSettings)
    story: StorySettings = group(StorySettings)
    screen: ScreenSettings = group(ScreenSettings)
    souvenir: SouvenirSettings = group(SouvenirSettings)
    health: HealthPageSettings = group(HealthPageSettings)
    alerts: AlertSettings = group(AlertSettings)
    care: CareSettings = group(CareSettings)


def load_profile(path: Path) -> KioskProfile:
    """Returns the profile in a TOML file, with defaults for missing keys.

    Raises:
        InputError: if the file cannot be read or has a later version, if a key or value is wrong, or if two
            edges of this computer have the same port.
    """
    profile = load_settings(KioskProfile, path)
    edges: Mapping[str, KioskEdge] = profile.edges or {"edge": KioskEdge()}
    characters = profile.characters or {"chair": KioskCharacter()}
    ports = [(edge.port, name) for name, edge in sorted(edges.items()) if not edge.address]
    for (port, name), (other_port, other) in zip(sorted(ports), sorted(ports)[1:], strict=False):
        if other_port - port < 2:
            raise InputError(
                f"the ports {port} and {other_port} of the edges {name} and {other} are too close",
                where=str(path),
                remedy="Use ports that differ by at least 2, because each edge also uses the next port.",
            )
    return replace(profile, edges=dict(edges), characters=dict(characters))
