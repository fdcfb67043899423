"""Draws a synthetic crowd once and stores it as a recording: visitors that enter, dance and leave."""

from __future__ import annotations

from pathlib import Path

from enliven.recording import Recorder
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.exercises import get_exercise
from enliven_synthesis.motion.motion import DanceMotion
from enliven_synthesis.sensor.ensemble import Appearance, Ensemble
from enliven_synthesis.sensor.profile import load_profile

RATE_HZ = 15.0
"""Frames per second of the sensor's clock. Drawing a frame takes longer than tracking it."""
WIDTH = 160
"""Width of a frame, pixels."""
VISITORS_PER_ROUND = 4
"""Number of visitors in each round of the recording."""


def draw_crowd(path: Path, seconds: float, seed: int) -> None:
    """Writes the recording: four visitors enter and leave one after another, and sometimes two are present.

    In the first and the last tenth, the room is empty.
    """
    parts = ((0.1, 0.45, "signals", -0.5), (0.3, 0.6, "stroll", 0.6))
    parts += ((0.62, 0.78, "turn", 0.3), (0.8, 0.9, "crouch", -0.2))
    cast = tuple(
        _visitor(seed + number, name, x, (start * seconds, stop * seconds))
        for number, (start, stop, name, x) in enumerate(parts)
    )
    scene = Ensemble(load_profile("tof"), cast, rate=RATE_HZ, seed=seed, width=WIDTH)
    unfinished = path.with_suffix(".part.mcap")
    with Recorder(unfinished, overwrite=True) as recorder:
        for number in range(round(seconds * RATE_HZ)):
            recorder.write_frame(scene.frame(number)[0])
    unfinished.replace(path)


def _visitor(seed: int, exercise: str, x: float, present: tuple[float, float]) -> Appearance:
    """Returns a visitor that moves while present. Each visitor has a different height."""
    performer = Performer(Proportions(height=1.55 + 0.1 * (seed % 4)))
    motion = DanceMotion(performer, get_exercise(exercise, seed))
    return Appearance(performer, motion, (x, -2.7), start=present[0], present=present)
