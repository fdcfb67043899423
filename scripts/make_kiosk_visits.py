"""Creates the visits that a kiosk without own recordings plays.

Synthetic people walk to the spot and move.

.venv/bin/python scripts/make_kiosk_visits.py

A visit contains bodies only. In the kiosk, these bodies possess its own characters. So a visit can be used
with any mesh.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from enliven.frames import BodyFrame
from enliven.person import Body
from enliven.recording import Recorder
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.choreographies import choreography_names, get_choreography
from enliven_synthesis.motion.dance import START_Z_M
from enliven_synthesis.motion.exercises import get_exercise
from enliven_synthesis.motion.motion import DanceMotion, MotionSegment, MotionSequence

FOLDER = Path(__file__).parents[1] / "viewer" / "enliven_viewer" / "kiosk" / "visits"
RATE_HZ = 15
"""Bodies per second. It is enough, because the kiosk interpolates between them, and the dances are slow."""
DECIMALS = 3
"""Number of decimals of a coordinate in metres. A millimetre is far below the width of a line on the
screen."""
STAND_S = 1.8
"""Seconds for which each visitor stands still. It is longer than the progress ring takes to fill."""
BLEND_S = 0.5
"""Seconds of the blend from one motion to the next."""
VISITS = {
    "chair": (("chair", "wave"), 1.72, 0, 50.0),
    "signals": (("signals", "overhead"), 1.62, 3, -50.0),
    "turn": (("turn", "wave"), 1.80, 5, 35.0),
}
"""For each visit: the motions after the walk, the performer's height in metres, the seed of the variations,
and the direction of the walk in degrees about +Y.

Direction 0 is towards the screen."""


def make_visit(motions: tuple[str, ...], height: float, seed: int, direction: float) -> list[Body]:
    """Returns the bodies of a visit to the spot at the origin."""
    performer = Performer(Proportions(height=height))
    walk = get_exercise("stroll", seed)
    end = performer.pose(walk.posture(walk.duration)).joints[0]
    yaw = np.radians(direction)
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    start = -turn @ (end[[0, 2]] - [0.0, START_Z_M])
    segments = [MotionSegment(0.0, DanceMotion(performer, walk), (start[0], start[1]), yaw)]
    begin = walk.duration + STAND_S
    segments.append(MotionSegment(walk.duration, DanceMotion(performer, get_choreography("idle"), True)))
    for name in motions:
        is_choreography = name in choreography_names()
        choreography = get_choreography(name) if is_choreography else get_exercise(name, seed)
        segments.append(MotionSegment(begin, DanceMotion(performer, choreography)))
        begin += choreography.duration
    sequence = MotionSequence(performer, tuple(segments), BLEND_S)
    count = round(sequence.duration * RATE_HZ)
    return [
        Body(1, np.round(sequence.figure(k / RATE_HZ).joints, DECIMALS), np.ones(20)) for k in range(count)
    ]


def main() -> None:
    """Writes all visits."""
    FOLDER.mkdir(exist_ok=True)
    for name, (motions, height, seed, direction) in VISITS.items():
        bodies = make_visit(motions, height, seed, direction)
        path = FOLDER / f"{name}.mcap"
        with Recorder(path, overwrite=True) as recorder:
            for k, body in enumerate(bodies):
                recorder.write_frame(BodyFrame([body], round(k * 1e9 / RATE_HZ), "synthetic visitor"))
        print(path.name, len(bodies), path.stat().st_size)


if __name__ == "__main__":
    main()
