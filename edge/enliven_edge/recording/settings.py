"""Settings of recordings that run for weeks: ``[recording]``."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import load_settings, setting


@dataclass(frozen=True)
class RecordingSettings:
    """The parts of a recording, and the space that is kept free on its disk."""

    part_minutes: float = setting(
        0.0,
        "Duration after which a recording continues in a new file. Each file can be read alone. 0 turns "
        "this off.",
        unit="min",
        low=0.0,
        high=1440.0,
    )
    part_mb: float = setting(
        0.0,
        "Size at which a recording continues in a new file. 0 turns this off.",
        unit="MB",
        low=0.0,
        high=1e6,
    )
    keep_free: float = setting(
        0.0,
        "Space that is kept free on the disk. To free space, the oldest recordings with the same name "
        "pattern are deleted. If this is not enough, the recording pauses. If 0, nothing is deleted.",
        unit="GB",
        low=0.0,
        high=10000.0,
    )


def settings_with_options(
    settings: RecordingSettings, part_minutes: float | None, keep_free: float | None
) -> RecordingSettings:
    """Returns the settings with the options of a command line. None keeps the setting.

    Raises:
        InputError: if an option is out of range.
    """
    options = {"part_minutes": part_minutes, "keep_free": keep_free}
    given_options = {key: value for key, value in options.items() if value is not None}
    return load_settings(RecordingSettings, {**vars(settings), **given_options}, where="command line")
