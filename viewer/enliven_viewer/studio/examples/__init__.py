"""Key poses in the studio: coverage of takes, edits, and solving beside the window."""

from enliven_viewer.studio.examples.coverage import Coverage, Coverages
from enliven_viewer.studio.examples.edits import (
    Held,
    added_switch,
    duplicated,
    guessed,
    held_of,
    mirrored_copy,
    moved_switch,
    paired,
    removed_switch,
    renamed_puppet,
    retimed,
    stood,
    with_default_settings,
    with_held,
    with_points,
    with_setting,
    without_held,
)
from enliven_viewer.studio.examples.exporting import Exporting
from enliven_viewer.studio.examples.solving import Solving
from enliven_viewer.studio.examples.times import layer_end, layer_of, seconds_at, time_of

__all__ = [
    "Coverage",
    "Coverages",
    "Exporting",
    "Held",
    "Solving",
    "added_switch",
    "duplicated",
    "guessed",
    "held_of",
    "layer_end",
    "layer_of",
    "mirrored_copy",
    "moved_switch",
    "paired",
    "removed_switch",
    "renamed_puppet",
    "retimed",
    "seconds_at",
    "stood",
    "time_of",
    "with_default_settings",
    "with_held",
    "with_points",
    "with_setting",
    "without_held",
]
