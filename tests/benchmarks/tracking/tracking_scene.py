"""The parts of a sequence: people, their builds and motions, furniture, and the sensor.

Recorded motions come from ENLIVEN_DATA. Sequences that need them are unavailable without it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from tracking_motions import motion_named
from tracking_seated import SittingDown

from enliven.formats.motion.bvh import read_bvh
from enliven.formats.motion.capture import Capture
from enliven.formats.motion.expmap import read_expmap
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.close_limbs import CloseLimbs
from enliven_synthesis.motion.exercises import get_exercise
from enliven_synthesis.motion.mocap import CapturedMotion
from enliven_synthesis.motion.motion import DanceMotion, FrozenMotion, Motion, MotionSegment, MotionSequence
from enliven_synthesis.sensor.ensemble import Appearance, Ensemble
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.scene import ROOM, Box

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data"))
SIDE, BACK = 1.5708, 3.1416


@dataclass(frozen=True)
class Move:
    """A motion by name.

    Attributes:
        source: "exercise", "close" (limbs close to the trunk), "turns" (turns and floor work), "seated"
            (sitting down on the floor), or the path of a capture in the data folder.
        name, seed: name and seed of the exercise, or of the motion with close limbs.
        start, stop: start and end in the capture, seconds.
        held: time of the exercise at which the performer stays, seconds, or None.
    """

    source: str
    name: str = ""
    seed: int = 0
    start: float = 0.0
    stop: float | None = None
    held: float | None = None

    @property
    def available(self) -> bool:
        return self.source in ("exercise", "close", "turns", "seated") or (DATA / self.source).exists()

    def made_for(self, performer: Performer) -> Motion:
        if self.source == "close":
            return CloseLimbs(performer, self.name, self.seed)
        if self.source == "turns":
            return DanceMotion(performer, motion_named(self.name, self.seed))
        if self.source == "seated":
            return SittingDown(performer, self.seed)
        if self.source == "exercise":
            danced = DanceMotion(performer, get_exercise(self.name, self.seed))
            return danced if self.held is None else FrozenMotion(danced, self.held)
        return CapturedMotion(performer, _capture(self.source), self.start, self.stop)


@cache
def _capture(source: str) -> Capture:
    path = DATA / source
    return read_bvh(path) if path.suffix == ".bvh" else read_expmap(path)


@dataclass(frozen=True)
class Person:
    """A performer's part.

    Attributes:
        moves: (seconds, move, place, yaw) one after the other.
        blend: length of the blend between two moves, seconds.
        present: (from, to) during which the person is in the room, seconds.
    """

    build: Proportions
    moves: tuple[tuple[float, Move, tuple[float, float], float], ...]
    blend: float = 0.0
    present: tuple[float, float] = (-1.0, 1e6)

    def appearance(self) -> Appearance:
        performer = Performer(self.build)
        legs = tuple(
            MotionSegment(t, move.made_for(performer), place, yaw) for t, move, place, yaw in self.moves
        )
        return Appearance(
            performer, MotionSequence(performer, legs, self.blend), (0.0, 0.0), 0.0, 0.0, self.present
        )


@dataclass(frozen=True)
class Sequence:
    """One sequence.

    Attributes:
        told: True if the frames contain the sensor's pose; otherwise it must be found from the floor.
        trouble: faults of the frame stream, named as in ``synthesis.trouble``; "knocked" turns the sensor
            half-way; "" is no fault.
        covered: (from, to) in which the lens is covered (a forced loss), seconds, or None.
        kind: "accuracy", "still" (jitter), "recovery" (a forced loss), "trouble".
    """

    name: str
    split: str
    people: tuple[Person, ...]
    seconds: float
    profile: str = "oak-d"
    height: float = 1.15
    tilt: float = 5.0
    furniture: tuple[Box, ...] = ()
    told: bool = False
    trouble: str = ""
    covered: tuple[float, float] | None = None
    kind: str = "accuracy"
    seed: int = field(default=7)

    @property
    def available(self) -> bool:
        return all(move.available for person in self.people for _, move, _, _ in person.moves)

    @property
    def scene(self) -> str:
        """Returns a description of the scene without its faults. Sequences with the same scene are rendered
        once."""
        if self.kind == "trouble" and self.trouble not in ("", "knocked"):
            return f"{self.split} signals"
        return self.name

    @property
    def frames(self) -> int:
        return round(self.seconds * load_profile(self.profile).camera.fps)

    def ensemble(self, *, knocked: bool = False) -> Ensemble:
        """Returns the scene. If ``knocked``, the sensor has its pose after the knock."""
        return Ensemble(
            load_profile(self.profile),
            tuple(person.appearance() for person in self.people),
            height=self.height - (0.06 if knocked else 0.0),
            tilt=self.tilt + (9.0 if knocked else 0.0),
            roll=7.0 if knocked else 0.0,
            room=ROOM + self.furniture,
            seed=self.seed,
            told=self.told,
        )


def exercise_move(name: str, seed: int = 0) -> Move:
    """Returns an exercise that the project generates."""
    return Move("exercise", name, seed)


HOME = (0.0, -2.7)
"""Default position of a performer, x and z, metres."""


def alone(
    build: Proportions, move: Move, place: tuple[float, float] = HOME, yaw: float = 0.0
) -> tuple[Person]:
    """Returns a cast of one person who makes one move at a position and yaw."""
    return (Person(build, ((0.0, move, place, yaw),)),)
