"""The settings of the studio that an artist may change."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from enliven.outputs.settings import LiveOutputSettings
from enliven.settings import group, parameter, setting
from enliven_viewer.settings import RenderSettings


@dataclass(frozen=True)
class StudioSettings:
    """The settings of the studio's window."""

    REMOVED_SETTINGS: ClassVar = ("snap", "matches")

    render: RenderSettings = group(RenderSettings, "Settings of the rendered image.")
    width: int = setting(1360, "Width of the window.", unit="pixels", low=640, high=16384)
    height: int = setting(820, "Height of the window.", unit="pixels", low=480, high=16384)
    reach: float = setting(
        11.0,
        "Maximum distance between a click and the joint or bone that the click selects.",
        unit="pixels",
        low=1,
        high=80,
    )
    frame_step: float = setting(1 / 30, "Time step of the arrow keys.", unit="seconds", low=0.001, high=1)
    shortest: float = parameter(
        2.0,
        "Minimum length of the timeline, for a project without motion.",
        unit="seconds",
        low=0.1,
        high=600,
    )
    autosave: float = setting(
        20.0,
        "Time between two recovery files. Increase this time if saving a large project interrupts your work.",
        unit="seconds",
        low=1,
        high=3600,
    )
    toast: float = setting(6.0, "Time for which a message stays visible.", unit="seconds", low=1, high=60)
    ghosts: int = setting(
        3, "Number of ghost poses (onion skin) on each side of the playhead.", low=0, high=20
    )
    ghost_step: float = setting(
        0.25, "Time between two ghosts of a shape without key poses.", unit="seconds", low=0.02, high=10
    )
    trail: float = setting(
        1.0, "Length of motion trails on each side of the playhead.", unit="seconds", low=0.05, high=30
    )
    outputs: dict[str, LiveOutputSettings] = field(
        default_factory=dict, metadata={"doc": "Other programs that receive the shown motion live, by name."}
    )
