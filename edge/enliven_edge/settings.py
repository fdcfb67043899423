"""All settings of the edge in one TOML file: ``enliven edge --settings edge.toml``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from enliven.errors import InputError
from enliven.possession import ActorSettings
from enliven.settings import load_settings, setting
from enliven_edge.controls import ControlSettings
from enliven_edge.fusion import CalibrationSettings, FusionSettings
from enliven_edge.landmarks import ColourSettings
from enliven_edge.physics import PhysicsSettings
from enliven_edge.sources import SourceSettings
from enliven_edge.stage import StageSettings
from enliven_edge.stage.puppet import PuppetSettings
from enliven_edge.stage.rig import MatchingSettings
from enliven_edge.tracking import TrackerSettings
from enliven_edge.tracking.health import HealthSettings


@dataclass(frozen=True)
class WireSettings:
    """Name, addresses and ports of the edge."""

    name: str = setting("edge", "The edge's name on the network, unique on this machine.")
    host: str = setting("127.0.0.1", "Address to listen on; 0.0.0.0 for every interface.")
    open: bool = setting(
        False, "Listen where other machines reach it: all who do may watch, and take hold of characters."
    )
    port: int = setting(5580, "Port of the poses; 0 picks a free one.", low=0, high=65535)
    control_port: int = setting(5581, "Port of the commands; 0 picks a free one.", low=0, high=65535)
    rate: float = setting(
        100.0, "Requests that one viewer is answered; more are refused.", unit="1/s", low=10, high=10_000
    )
    picture: bool = setting(
        True, "Tell viewers where the camera stands, with a small picture of distances, five times a second."
    )
    budget: float = setting(
        2.0,
        "Time a frame for what viewers ask: half for reading it, half for doing it; the rest waits.",
        unit="ms",
        low=0.5,
        high=100.0,
    )


@dataclass(frozen=True)
class CharacterSettings:
    """One of several characters, in a settings file: ``[characters.NAME]``."""

    mesh: str = setting("chair", "A mesh, 'chair', 'lamp', or a puppet: its session, project, or 'cactus'.")
    drive: Literal["", "graph", "skeleton"] = setting("", "What moves it; empty: as the setting drive says.")
    parts: str = setting("", "What takes hold of it: legs, 'legs / torso', ...; empty: what suits the mesh.")


CharacterChoice = tuple[str, CharacterSettings]
"""A requested character: its name, empty if it must be derived, and its settings."""


@dataclass(frozen=True)
class EdgeSettings:
    """The settings of the edge."""

    nodes: int = setting(128, "Nodes of a deformation graph.", low=4, high=4096)
    drive: Literal["graph", "skeleton"] = setting(
        "graph",
        "What moves a model: a deformation graph, for any mesh, or the skeleton of a rigged glTF.",
    )
    up: Literal["", "x", "y", "z"] = setting("", "The mesh's own axis that points up; empty: it is guessed.")
    tracker: TrackerSettings = setting(TrackerSettings, "The tracker.")
    actor: ActorSettings = setting(ActorSettings, "How characters meet and follow their performers.")
    matching: MatchingSettings = setting(MatchingSettings, "Posing to choose a part of a rigged model.")
    puppet: PuppetSettings = setting(PuppetSettings, "How puppets meet and follow their performers.")
    stage: StageSettings = setting(StageSettings, "How many characters stand on the stage.")
    colour: ColourSettings = setting(ColourSettings, "The colour image, where there is one.")
    health: HealthSettings = setting(HealthSettings, "When something is said to be wrong.")
    physics: PhysicsSettings = setting(PhysicsSettings, "Loose boxes and balls.")
    wire: WireSettings = setting(WireSettings, "The network.")
    characters: dict[str, CharacterSettings] = field(
        default_factory=dict,
        metadata={"doc": "The characters by name, where the command line names none."},
    )
    controls: dict[str, ControlSettings] = field(
        default_factory=dict, metadata={"doc": "Pedals, button panels and microphones, by name."}
    )
    sensors: dict[str, SourceSettings] = field(
        default_factory=dict, metadata={"doc": "The sensors by name, where the command line names none."}
    )
    space: str = setting("", "The file of enliven calibrate, for several sensors; beside this file.")
    calibration: CalibrationSettings = setting(CalibrationSettings, "How sensors are found, and how well.")
    fusion: FusionSettings = setting(FusionSettings, "How bodies of several sensors become one set.")


def characters_of(
    meshes: Sequence[str],
    drives: Sequence[str],
    parts: Sequence[str],
    settings: Mapping[str, CharacterSettings],
) -> list[CharacterChoice]:
    """Returns the characters of the command line. Without any, those of the settings, or else a chair.

    Args:
        meshes: as ``--mesh`` names them.
        drives, parts: one for all characters, or one for each in their order.

    Raises:
        InputError: for another number of values, or an unknown drive.
    """
    chosen: list[CharacterChoice] = list(settings.items())
    if meshes or not chosen:
        chosen = [("", CharacterSettings(mesh)) for mesh in meshes or ("chair",)]
    for option, given in (("drive", drives), ("parts", parts)):
        if len(given) not in (0, 1, len(chosen)):
            mend = f"Give one for all, or one for each of the {len(chosen)} characters in their order."
            raise InputError(f"--{option} is given {len(given)} times", where="command line", mend=mend)
        for k, word in enumerate(list(given) * len(chosen) if len(given) == 1 else given):
            name, one = chosen[k]
            checked = load_settings(CharacterSettings, {**vars(one), option: word}, where=f"--{option}")
            chosen[k] = (name, checked)
    return chosen
