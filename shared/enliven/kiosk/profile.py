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
    """One edge of a kiosk: ``[edges.NAME]``. If it has an address, it runs on another computer."""

    settings: str = setting("", "File of the edge's settings (TOML). Empty: the defaults.")
    arguments: tuple[str, ...] = setting((), "More arguments of `enliven edge`, such as `--sensor`, `oak`.")
    address: str = setting(
        "", "Address of an edge on another computer, HOST or HOST:PORT. Empty: it is started on this one."
    )
    port: int = setting(
        5580, "Network port of its pose stream. Commands use the next one.", low=1, high=65534
    )


@dataclass(frozen=True)
class KioskCharacter:
    """One character that visitors can choose: ``[characters.NAME]``."""

    mesh: str = setting("chair", "Path of a mesh, session or project, or 'chair', 'lamp' or 'cactus'.")
    title: str = setting("", "Its name on the screen. Empty: the name of its table.")
    parts: str = setting(
        "", "Body parts that hold it, such as 'all' or 'legs'. Empty: chosen to suit the mesh."
    )
    drive: Literal["", "graph", "skeleton"] = setting("", "How it is driven. Empty: chosen to suit the mesh.")


@dataclass(frozen=True)
class ZoneSettings:
    """The zone of the floor in which visitors are noticed, and the spot at which they take a character."""

    center: tuple[float, float] = setting(
        (0.0, -2.5),
        "Center of the spot on the floor (x, z). A camera at the origin looks along -z.",
        unit="m",
    )
    width: float = setting(3.0, "Width of the zone.", unit="m", low=0.5, high=20.0)
    depth: float = setting(3.0, "Depth of the zone.", unit="m", low=0.5, high=20.0)
    space: str = setting(
        "",
        "File with the places of several edges, from enliven calibrate. The zone is in the world of the "
        "first edge. Empty: all edges have one world.",
    )
    spot: float = setting(
        0.5, "Radius of the spot where a visitor takes a character.", unit="m", low=0.2, high=3.0
    )


@dataclass(frozen=True)
class StorySettings:
    """The actions of the kiosk for its visitors, and their durations."""

    attract: tuple[str, ...] = setting(
        (), "Recorded performances that play without visitors (.mcap). Empty: the shipped ones."
    )
    dwell: float = setting(
        1.5, "Time on the spot until the visitor takes the character.", unit="s", low=0.3, high=10.0
    )
    lost: float = setting(2.0, "Time without a visitor until the farewell.", unit="s", low=0.2, high=30.0)
    session: float = setting(
        120.0, "Longest time with a character. 0: no limit.", unit="s", low=0.0, high=3600.0
    )
    farewell: float = setting(4.0, "Duration of the farewell.", unit="s", low=0.5, high=30.0)
    choose: Literal["", "step", "hand", "button"] = setting(
        "step",
        "How visitors change the character: a step to the side, a raised hand, or a button. Empty: never.",
    )
    performers: int = setting(
        1, "Number of visitors that can have a character at the same time.", low=1, high=6
    )
    language: str = setting("", "Language of the words on the screen. Empty: the computer's.")
    sound: bool = setting(False, "Plays sounds when a visitor is noticed, takes a character and leaves it.")


@dataclass(frozen=True)
class ScreenSettings:
    """The screen of the kiosk."""

    number: int = setting(0, "Number of the monitor, from 0.", low=0, high=15)
    size: str = setting("", "Size of the window, such as 1920x1080. Empty: the whole monitor.")
    turn: Literal[0, 90, 180, 270] = setting(
        0, "Rotation of the picture, for an upright monitor.", unit="degrees"
    )
    settings: str = setting(
        "", "File of the viewer's settings (TOML) for light, backdrop and floor. Empty: the defaults."
    )


@dataclass(frozen=True)
class SouvenirSettings:
    """Settings for souvenirs: a photo or film of each visitor's character, for the visitor's phone. Off by
    default.

    A souvenir shows the characters on the screen. It does not contain images of the camera.
    """

    kind: Literal["", "photo", "film"] = setting(
        "", "Souvenir of each session: a photo or a film. Empty: none is made or kept."
    )
    keep: float = setting(
        30.0, "Time until a souvenir is deleted.", unit="minutes", low=1.0, high=MAX_SOUVENIR_AGE_S / 60.0
    )
    space: float = setting(
        200.0, "Largest size of all souvenirs. The oldest are deleted.", unit="MB", low=50.0, high=10000.0
    )
    length: float = setting(6.0, "Longest duration of a film.", unit="s", low=2.0, high=30.0)
    code: float = parameter(20.0, "Time for which the QR code is shown.", unit="s", low=5.0, high=120.0)
    host: str = setting(
        "127.0.0.1",
        "Network address to listen on, such as 0.0.0.0. Phones cannot reach 127.0.0.1.",
    )
    port: int = setting(5592, "Network port.", low=1, high=65535)
    address: str = setting(
        "",
        "Start of the address in the QR code, such as http://kiosk.example:5592/. Empty: this computer's "
        "address in its network.",
    )
    certificate: str = setting("", "TLS certificate (PEM). Empty: souvenirs are sent without encryption.")
    certificate_key: str = setting("", "Key of the TLS certificate (PEM), readable for its owner only.")


@dataclass(frozen=True)
class AlertSettings:
    """Settings for alerts, which inform operators about problems."""

    webhook: str = setting("", "Address (URL) that receives each alert as JSON. Empty: none.")
    command: str = setting(
        "", "Command that is run for each alert, with the alert as JSON on its standard input."
    )
    quiet: float = setting(
        600.0, "Shortest time between two alerts about the same problem.", unit="s", low=10.0, high=86400.0
    )


@dataclass(frozen=True)
class HealthPageSettings:
    """The health page."""

    host: str = setting(
        "127.0.0.1", "Network address to listen on. Beyond loopback it needs a password and TLS."
    )
    port: int = setting(5590, "Network port.", low=1, high=65535)
    password_file: str = setting("", "File with the password, readable for its owner only.")
    certificate: str = setting("", "TLS certificate (PEM).")
    certificate_key: str = setting("", "Key of the TLS certificate (PEM), readable for its owner only.")


@dataclass(frozen=True)
class CareSettings:
    """Maintenance settings for a computer that runs for weeks."""

    restart_at: str = setting("", "Time of a nightly restart of all programs, such as 04:00. Empty: none.")
    recordings: str = setting(
        "", "Folder for recordings of the visits (bodies and poses). Empty: none are made."
    )
    keep_free: float = setting(
        1.0,
        "Space that is kept free on the disk. Oldest recordings are deleted.",
        unit="GB",
        low=0.1,
        high=10000.0,
    )
    frozen_after: float = setting(
        10.0, "Time without visible progress until a program is restarted.", unit="s", low=2.0, high=600.0
    )


@dataclass(frozen=True)
class KioskProfile:
    """All settings of a kiosk."""

    name: str = setting("kiosk", "Name of the kiosk, for operators.")
    edges: dict[str, KioskEdge] = field(
        default_factory=dict, metadata={"doc": "The edges, by name. None: one with the defaults."}
    )
    characters: dict[str, KioskCharacter] = field(
        default_factory=dict, metadata={"doc": "The characters, by name. None: the chair."}
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
                f"the edges {name} and {other} have the ports {port} and {other_port}",
                where=str(path),
                remedy="Give each edge a port at least 2 above the one before: it also uses the next one.",
            )
    return replace(profile, edges=dict(edges), characters=dict(characters))
