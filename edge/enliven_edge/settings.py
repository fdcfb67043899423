"""All settings of the edge in one TOML file: ``enliven edge --settings edge.toml``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from enliven.errors import InputError
from enliven.keys.roles import Role
from enliven.outputs.settings import LiveOutputSettings
from enliven.possession import ActorSettings
from enliven.settings import group, load_settings, parameter, setting
from enliven_edge.controls.settings import ControlSettings
from enliven_edge.fusion.settings import CalibrationSettings, FusionSettings
from enliven_edge.landmarks.colour_pose import ColourSettings
from enliven_edge.physics.settings import PhysicsSettings
from enliven_edge.recording.settings import RecordingSettings
from enliven_edge.sources import SensorCareSettings, SourceSettings
from enliven_edge.stage.puppet.settings import PuppetSettings
from enliven_edge.stage.rig.settings import MatchingSettings
from enliven_edge.stage.stage_capacity import StageSettings
from enliven_edge.tracking.health.health import HealthSettings
from enliven_edge.tracking.settings import TrackerSettings


@dataclass(frozen=True)
class WireSettings:
    """Name, addresses and ports of the edge."""

    name: str = setting("edge", "Name of the edge on the network, unique on this computer.")
    host: str = setting("127.0.0.1", "Network address to listen on. 0.0.0.0 listens on every interface.")
    insecure: bool = setting(
        False,
        "Uses no keys. Everyone who can reach the edge can then watch, and control characters.",
        formerly="open",
    )
    pairing_minutes: float = setting(
        10.0,
        "Time after the start in which viewers on other computers can pair with the code that the edge "
        "shows. If 0, viewers can pair only after an operator has requested the code.",
        unit="min",
        low=0.0,
        high=1440.0,
    )
    pairing_role: Role = setting("operate", "Highest role that pairing with a code grants.")
    port: int = setting(5580, "Network port of the pose stream. 0 picks a free port.", low=0, high=65535)
    control_port: int = setting(5581, "Network port of the commands. 0 picks a free port.", low=0, high=65535)
    rate: float = parameter(
        100.0,
        "Maximum number of requests per second from one viewer. Further requests are refused.",
        unit="1/s",
        low=10,
        high=10_000,
    )
    picture: bool = setting(
        True, "Sends the camera pose and a small depth image to viewers five times per second."
    )
    announce: bool = setting(
        True,
        "Announces the edge on the local network, so that viewers find it. This needs the extra "
        "'discovery' and an address that other computers can reach.",
    )
    budget: float = parameter(
        2.0,
        "Time per frame for viewers' requests, half for reading and half for executing them. Further "
        "requests wait for the next frame, so that characters do not stall.",
        unit="ms",
        low=0.5,
        high=100.0,
    )


@dataclass(frozen=True)
class CharacterSettings:
    """Settings of one of several characters in a settings file: ``[characters.NAME]``."""

    mesh: str = setting(
        "chair", "Path of a mesh, session or project, or one of 'chair', 'lamp' and 'cactus'."
    )
    drive: Literal["", "graph", "skeleton"] = setting(
        "", "How the character is driven. If empty, the setting `drive` of the edge applies."
    )
    parts: str = setting(
        "",
        "Body parts that possess the character, such as legs or 'legs / torso'. If empty, suitable parts "
        "are chosen for the mesh.",
    )


_NAMED_MESH = re.compile(r"([A-Za-z0-9_-]{1,40})=(.+)")
"""Pattern of a value of ``--mesh`` with the name of the character: NAME=MESH."""
CharacterChoice = tuple[str, CharacterSettings]
"""A requested character: its name (empty if it must be derived) and its settings."""


@dataclass(frozen=True)
class EdgeSettings:
    """The settings of the edge."""

    nodes: int = setting(
        128,
        "Number of nodes of a deformation graph. More nodes bend in finer detail but take longer.",
        low=4,
        high=4096,
    )
    drive: Literal["graph", "skeleton"] = setting(
        "graph",
        "How a model is driven: by a deformation graph (any mesh), or by the skeleton of a rigged glTF.",
    )
    up: Literal["", "x", "y", "z"] = setting("", "Axis of the mesh that points up. If empty, it is detected.")
    tracker: TrackerSettings = group(TrackerSettings, "Tracking of people.")
    actor: ActorSettings = group(ActorSettings, "How characters approach and follow their performers.")
    matching: MatchingSettings = group(MatchingSettings, "Choosing a part of a rigged model by posing.")
    puppet: PuppetSettings = group(PuppetSettings, "How puppets approach and follow their performers.")
    stage: StageSettings = group(StageSettings, "Number of characters on the stage.")
    colour: ColourSettings = group(ColourSettings, "Use of the colour image, if the sensor has one.")
    health: HealthSettings = group(HealthSettings, "Limits for reporting problems.")
    physics: PhysicsSettings = group(PhysicsSettings, "Boxes and balls that characters can push.")
    recording: RecordingSettings = group(
        RecordingSettings, "Parts of the recorded take, and the space that is kept free on its disk."
    )
    wire: WireSettings = group(WireSettings, "Network name, addresses and ports.")
    characters: dict[str, CharacterSettings] = field(
        default_factory=dict,
        metadata={"doc": "The characters by name. They are used if the command line names no character."},
    )
    controls: dict[str, ControlSettings] = field(
        default_factory=dict, metadata={"doc": "Pedals, button panels and microphones, by name."}
    )
    outputs: dict[str, LiveOutputSettings] = field(
        default_factory=dict, metadata={"doc": "Other programs that receive the motion live, by name."}
    )
    sensors: dict[str, SourceSettings] = field(
        default_factory=dict,
        metadata={"doc": "The sensors by name. They are used if the command line names no sensor."},
    )
    sensor: SensorCareSettings = group(SensorCareSettings, "Recovery of cameras that hang.")
    space: str = setting(
        "", "Path of the result of `enliven calibrate` for several sensors, relative to this file."
    )
    calibration: CalibrationSettings = group(
        CalibrationSettings, "Calibration of several sensors, and the required accuracy."
    )
    fusion: FusionSettings = group(FusionSettings, "Fusion of several sensors' bodies.")


def characters_from_options(
    meshes: Sequence[str],
    drives: Sequence[str],
    parts: Sequence[str],
    settings: Mapping[str, CharacterSettings],
) -> list[CharacterChoice]:
    """Returns the characters of the command line.

    Without any, returns those of the settings, or else a chair.

    Args:
        meshes: the values of ``--mesh``. NAME=FILE gives a character a name.
        drives, parts: one value for all characters, or one for each in their order.

    Raises:
        InputError: for another number of values, or an unknown drive.
    """
    chosen: list[CharacterChoice] = list(settings.items())
    if meshes or not chosen:
        chosen = [_character_from_option(mesh) for mesh in meshes or ("chair",)]
    for option, words in (("drive", drives), ("parts", parts)):
        if len(words) not in (0, 1, len(chosen)):
            remedy = (
                f"Use the option once for all characters, or once for each of the {len(chosen)} "
                "characters, in order."
            )
            raise InputError(f"--{option} is given {len(words)} times", where="command line", remedy=remedy)
        for k, word in enumerate(list(words) * len(chosen) if len(words) == 1 else words):
            name, character = chosen[k]
            checked = load_settings(CharacterSettings, {**vars(character), option: word}, where=f"--{option}")
            chosen[k] = (name, checked)
    return chosen


def _character_from_option(mesh: str) -> CharacterChoice:
    """Returns the character of one ``--mesh``: a mesh, or NAME=MESH. A text that is the path of an existing
    file is a mesh.
    """
    match = _NAMED_MESH.fullmatch(mesh)
    if match is None or Path(mesh).exists():
        return "", CharacterSettings(mesh)
    return match[1], CharacterSettings(match[2])
