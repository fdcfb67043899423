"""The sequences on which tracking is measured: who does what before which sensor.

"tuning" sequences may be looked at and tuned on; the reported figures are of "held-out" ones, which have
other motions and other builds. Recorded motions come from ENLIVEN_DATA; without it the sequences that need
them are left out, and every kind of difficulty is still covered by motions that this project makes.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from enliven.formats.motion.bvh import read_bvh
from enliven.formats.motion.capture import Capture
from enliven.formats.motion.expmap import read_expmap
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.close_limbs import CloseLimbs
from enliven_synthesis.motion.exercises import exercise
from enliven_synthesis.motion.mocap import Captured
from enliven_synthesis.motion.motion import Chained, Danced, HeldMotion, Motion, MotionSegment
from enliven_synthesis.sensor.ensemble import Appearance, Ensemble
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.scene import ROOM, Box

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data"))
TUNING, HELD_OUT = "tuning", "held-out"
CLOSE, OPENED = "close", "opened"
"""Limbs close before the trunk, to tune on; the second split was sealed until November 26, and is spent."""
SEALED = "sealed"
"""The split that is kept shut: it is measured once, when nothing is tuned any more."""
SIDE, BACK = 1.5708, 3.1416

DESK = (
    Box((-0.75, 0.0, -1.95), (0.75, 0.74, -1.90)),
    Box((-0.80, 0.74, -2.15), (0.80, 0.78, -1.60)),
)
"""A desk with a closed front, before the performer."""
PILLAR = (Box((-0.16, 0.0, -2.0), (0.16, 2.7, -1.75)), Box((0.75, 0.0, -2.35), (1.30, 0.95, -1.95)))
"""A pillar and an armchair, between which somebody walks."""


@dataclass(frozen=True)
class Move:
    """A motion by name.

    Attributes:
        source: "exercise", "close" (limbs close to the trunk), or the path of a capture in the data folder.
        name, seed: of the exercise, or of the motion with close limbs.
        start, stop: seconds of the capture.
        held: the second of an exercise at which the performer stays, or None.
    """

    source: str
    name: str = ""
    seed: int = 0
    start: float = 0.0
    stop: float | None = None
    held: float | None = None

    @property
    def available(self) -> bool:
        return self.source in ("exercise", "close") or (DATA / self.source).exists()

    def made_for(self, performer: Performer) -> Motion:
        if self.source == "close":
            return CloseLimbs(performer, self.name, self.seed)
        if self.source == "exercise":
            danced = Danced(performer, exercise(self.name, self.seed))
            return danced if self.held is None else HeldMotion(danced, self.held)
        return Captured(performer, _capture(self.source), self.start, self.stop)


@cache
def _capture(source: str) -> Capture:
    path = DATA / source
    return read_bvh(path) if path.suffix == ".bvh" else read_expmap(path)


@dataclass(frozen=True)
class Person:
    """A performer's part.

    Attributes:
        moves: (seconds, move, place, yaw) one after the other.
        blend: seconds of going over from one to the next.
        present: seconds between which the person is there at all.
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
        return Appearance(performer, Chained(performer, legs, self.blend), (0.0, 0.0), 0.0, 0.0, self.present)


@dataclass(frozen=True)
class Sequence:
    """One sequence.

    Attributes:
        told: whether the frames say where the sensor stands; else it must be found from the floor.
        trouble: what befalls the frames on their way, named as in ``synthesis.trouble``; "knocked" turns
            the sensor half-way; "" nothing.
        covered: seconds between which the lens is covered (a forced loss), or None.
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
        """What is to be seen, whatever befalls its frames: sequences that share it are rendered once."""
        if self.kind == "trouble" and self.trouble not in ("", "knocked"):
            return f"{self.split} signals"
        return self.name

    @property
    def frames(self) -> int:
        return round(self.seconds * load_profile(self.profile).camera.fps)

    def ensemble(self, *, knocked: bool = False) -> Ensemble:
        """The scene; ``knocked`` with the sensor as it lies after the knock."""
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


TALL = Proportions(1.88, 0.95, shoulders=1.05)
SMALL = Proportions(1.58, 1.0, shoulders=0.93, hips=1.08)
AVERAGE = Proportions(1.75)
STOUT = Proportions(1.70, 1.28, hips=1.1)
CHILD = Proportions(1.32, 0.98, shoulders=0.92, legs=0.96)
INFANT = Proportions(1.22, 1.06, shoulders=0.95)
LANKY = Proportions(1.93, 0.86, arms=1.06, legs=1.04)
BROAD = Proportions(1.80, 1.18, shoulders=1.12, legs=0.95)
SLIM = Proportions(1.66, 0.86, hips=1.05, arms=0.97)

_EX: Callable[..., Move] = lambda name, seed=0: Move("exercise", name, seed)  # noqa: E731
CMU, NAMCO, OTHER = "bvh/cmu_mirrors", "bvh/bandai_namco", "bvh/other"
_HOME = (0.0, -2.7)


def _one(
    build: Proportions, move: Move, place: tuple[float, float] = _HOME, yaw: float = 0.0
) -> tuple[Person]:
    return (Person(build, ((0.0, move, place, yaw),)),)


def _accuracy() -> list[Sequence]:
    """One or more performers before a sensor that behaves."""
    t, h = TUNING, HELD_OUT
    wave = f"{NAMCO}/dataset-2_wave-both-hands_normal_001.bvh"
    call = f"{NAMCO}/dataset-1_call_normal_001.bvh"
    punch = f"{NAMCO}/dataset-1_punch_normal_001.bvh"
    stroll = f"{NAMCO}/dataset-1_walk_childish_001.bvh"
    music = f"{NAMCO}/dataset-1_walk_musical_001.bvh"
    traffic = "cmu_expmap/train_directing_traffic_4.txt"
    boxing, jumps = f"{CMU}/Boxing_Toes.bvh", f"{CMU}/01_01.bvh"
    bends, eight = f"{OTHER}/aitviewer_sample.bvh", f"{OTHER}/pymo_AV_8Walk_Meredith.bvh"
    styled = "bvh/xia_styles/depressed_18_000.bvh"
    walk, side = f"{CMU}/02_01.bvh", f"{NAMCO}/dataset-1_walk_normal_001.bvh"
    return [
        # what may be tuned on
        Sequence("still", t, _one(AVERAGE, _EX("still")), 3.0, kind="still"),
        Sequence("overhead", t, _one(TALL, _EX("overhead"), (0.1, -2.9)), 5.0),
        Sequence("crouch", t, _one(AVERAGE, _EX("crouch")), 4.5),
        Sequence("kneel", t, _one(SMALL, _EX("kneel"), (-0.2, -2.5)), 5.0, "kinect1"),
        Sequence("floor", t, _one(AVERAGE, _EX("floor")), 5.0),
        Sequence("turn", t, _one(STOUT, _EX("turn")), 7.0),
        Sequence("one leg", t, _one(AVERAGE, _EX("one leg")), 5.0, "kinect1"),
        Sequence("signals side", t, _one(SMALL, _EX("signals"), yaw=SIDE), 4.0),
        Sequence("crossed tof", t, _one(AVERAGE, _EX("crossed"), (0.0, -2.3)), 4.0, "tof"),
        Sequence("wave", t, _one(TALL, Move(wave)), 3.0, "kinect1"),
        Sequence("punch", t, _one(STOUT, Move(punch, stop=5.0)), 4.0),
        Sequence("childish walk", t, _one(AVERAGE, Move(stroll, start=1.0), (-0.3, -3.6)), 2.4),
        Sequence("call back", t, _one(SMALL, Move(call), yaw=BACK), 4.0),
        Sequence("cross", t, _crossing((AVERAGE, SMALL), 0), 5.0),
        Sequence("touch", t, _touching((TALL, SMALL), 0), 4.5),
        Sequence("three", t, _three(), 4.0),
        Sequence("four", t, _four_others(), 3.0),
        Sequence("five, in two rows", t, _two_rows(), 3.0),
        Sequence("desk", t, _one(AVERAGE, _EX("signals", 3), (0.0, -2.7)), 4.0, furniture=DESK, told=True),
        Sequence("high camera", t, _one(TALL, _EX("signals", 71), (0.2, -2.9)), 3.5, height=2.2, tilt=24.0),
        Sequence("child overhead", t, _one(INFANT, _EX("overhead", 91), (0.1, -2.3)), 4.0),
        Sequence("child back", t, _one(INFANT, Move(wave), (0.0, -2.2), BACK), 2.5),
        Sequence("bow", t, _one(STOUT, Move(f"{NAMCO}/dataset-1_bow_normal_001.bvh")), 3.0),
        Sequence("walk side", t, _one(TALL, Move(side), (-1.0, -3.0), SIDE), 2.5, "kinect1"),
        Sequence("styled walk", t, _one(SMALL, Move(styled), (0.3, -3.6)), 3.0),
        # what is reported
        Sequence("h still", h, _one(SLIM, _EX("still", 5)), 4.0, kind="still"),
        Sequence("h overhead", h, _one(CHILD, _EX("overhead", 11), (-0.1, -2.4)), 5.0),
        Sequence("h crouch", h, _one(LANKY, _EX("crouch", 12), (0.2, -3.0)), 5.0, "kinect1"),
        Sequence("h kneel", h, _one(BROAD, _EX("kneel", 13), yaw=0.6), 5.0),
        Sequence("h floor", h, _one(SLIM, _EX("floor", 14), yaw=-0.4), 5.0),
        Sequence("h turn", h, _one(LANKY, _EX("turn", 15), (0.0, -2.9)), 7.0),
        Sequence("h one leg", h, _one(SLIM, _EX("one leg", 16), yaw=0.3), 5.0),
        Sequence("h signals side", h, _one(BROAD, _EX("signals", 17), yaw=-SIDE), 4.0, "kinect1"),
        Sequence("h crossed tof", h, _one(BROAD, _EX("crossed", 18), (0.1, -2.2)), 4.0, "tof"),
        Sequence("h traffic", h, _one(LANKY, Move(traffic, start=1.0), (0.0, -2.6)), 6.0),
        Sequence("h boxing", h, _one(BROAD, Move(boxing, start=8.0), (0.1, -2.6)), 5.0, "kinect1"),
        Sequence("h fall", h, _one(BROAD, Move(boxing, start=22.5), (0.0, -3.0)), 7.5),
        Sequence("h bends", h, _one(SLIM, Move(bends, start=3.0), (0.1, -2.7)), 6.0),
        Sequence("h jumps", h, _one(CHILD, Move(jumps, start=0.8), (0.6, -3.2), -0.6), 4.0),
        Sequence("h dance", h, _one(LANKY, Move(music, start=5.5), (-1.1, -3.0), SIDE), 3.4),
        Sequence("h walk in", h, _one(BROAD, Move(walk, start=0.4), (-0.4, -3.6)), 1.8, "kinect1"),
        Sequence("h eight", h, _one(SLIM, Move(eight, start=4.0), (1.0, -2.9)), 2.2),
        Sequence("h back", h, _one(CHILD, Move(traffic, start=12.0), (0.0, -2.4), BACK), 4.0),
        Sequence("h cross", h, _crossing((LANKY, SLIM), 21), 5.0, "kinect1"),
        Sequence("h touch", h, _touching((BROAD, SLIM), 22), 4.5),
        Sequence("h four", h, _four(), 4.0),
        Sequence("h leave", h, _leaving((LANKY, CHILD)), 9.0),
        Sequence("h high camera", h, _one(SLIM, _EX("crossed", 72)), 3.5, "kinect1", height=2.3, tilt=26.0),
        Sequence("h low camera", h, _one(LANKY, _EX("signals", 73)), 3.5, height=0.55, tilt=-6.0),
        Sequence("h pillar", h, _one(SLIM, _EX("stroll", 24), (-1.7, -2.9), SIDE), 4.5, furniture=PILLAR),
    ]  # fmt: skip


def _crossing(builds: tuple[Proportions, Proportions], seed: int) -> tuple[Person, ...]:
    """Two walk across the image, one behind the other."""
    one, two = (_EX("stroll", seed), _EX("stroll", seed + 1 if seed else 0))
    return (
        Person(builds[0], ((0.2, one, (-1.6, -2.6), SIDE),)),
        Person(builds[1], ((0.2, two, (1.6, -3.3), -SIDE),)),
    )


def _touching(builds: tuple[Proportions, Proportions], seed: int) -> tuple[Person, ...]:
    """Two stand side by side; one gives the other a hand."""
    return (
        Person(builds[0], ((0.0, _EX("touch", seed), (-0.55, -2.7), 0.0),)),
        Person(builds[1], ((0.0, _EX("crossed", seed), (0.42, -2.75), -0.2),)),
    )


def _three() -> tuple[Person, ...]:
    return (
        Person(AVERAGE, ((0.0, _EX("signals", 6), (-1.1, -3.1), 0.3),)),
        Person(TALL, ((0.0, _EX("one leg", 6), (0.0, -3.3), 0.0),)),
        Person(STOUT, ((0.0, _EX("crossed", 6), (1.0, -2.9), -0.3),)),
    )


def _four() -> tuple[Person, ...]:
    return (
        Person(BROAD, ((0.0, _EX("signals", 31), (-1.25, -3.2), 0.3),)),
        Person(SLIM, ((0.0, _EX("crossed", 32), (-0.35, -2.6), 0.1),)),
        Person(LANKY, ((0.0, _EX("overhead", 33), (0.55, -3.4), -0.2),)),
        Person(CHILD, ((0.0, _EX("one leg", 34), (1.1, -2.7), -0.4),)),
    )


def _four_others() -> tuple[Person, ...]:
    """Four who are others, and elsewhere, than those of "h four"."""
    return (
        Person(SMALL, ((0.0, _EX("crossed", 81), (-1.15, -2.6), 0.3),)),
        Person(TALL, ((0.0, _EX("signals", 82), (-0.45, -3.3), -0.1),)),
        Person(STOUT, ((0.0, _EX("still", 83), (0.35, -2.75), 0.2),)),
        Person(AVERAGE, ((0.0, _EX("signals", 84), (1.2, -3.25), -0.3),)),
    )


def _two_rows() -> tuple[Person, ...]:
    """Three before, and two behind who stand in the gaps."""
    return (
        Person(SMALL, ((0.0, _EX("still", 85), (-0.95, -2.55), 0.2),)),
        Person(AVERAGE, ((0.0, _EX("crossed", 86), (0.05, -2.6), 0.0),)),
        Person(STOUT, ((0.0, _EX("still", 87), (1.0, -2.6), -0.2),)),
        Person(TALL, ((0.0, _EX("signals", 88), (-0.5, -3.5), 0.1),)),
        Person(Proportions(1.82), ((0.0, _EX("crossed", 89), (0.65, -3.55), -0.1),)),
    )


def _leaving(builds: tuple[Proportions, Proportions]) -> tuple[Person, ...]:
    """One stays; the other walks out of the image, and comes back from where they left."""
    stay = _EX("crossed", 41)
    return (
        Person(builds[0], ((0.0, stay, (-0.6, -2.8), 0.2), (5.0, stay, (-0.6, -2.8), 0.2)), 0.5),
        Person(
            builds[1],
            ((0.3, _EX("stroll", 42), (0.5, -2.7), SIDE), (5.0, _EX("stroll", 43), (3.3, -2.7), -SIDE)),
        ),
    )


_HARD: tuple[tuple[str, Move, float, float], ...] = (
    ("overhead", _EX("overhead"), 3.2, 0.0),
    ("floor", _EX("floor"), 2.1, 0.0),
    ("crouch", _EX("crouch"), 2.0, 0.0),
    ("kneel", _EX("kneel"), 2.4, 0.3),
    ("side", _EX("signals"), 1.3, SIDE),
    ("back", _EX("crossed"), 3.1, BACK),
    ("one leg", _EX("one leg"), 1.7, 0.0),
)
"""Name, exercise, second of it, yaw: the postures in which a performer is lost and must be found again."""


def recoveries() -> list[Sequence]:
    """A covered lens for a second, in which the performer goes from standing into a hard posture."""
    out = []
    for split, builds, shift in ((TUNING, (AVERAGE, STOUT), 0), (HELD_OUT, (SLIM, BROAD, CHILD), 50)):
        for n, (name, move, at, yaw) in enumerate(_HARD):
            if split == TUNING and n % 2:
                continue
            seed = 0 if split == TUNING else shift + n
            held = Move("exercise", move.name, seed, held=at)
            person = Person(
                builds[n % len(builds)],
                ((0.0, _EX("still", seed), _HOME, yaw), (1.0, held, _HOME, yaw)),
                0.5,
            )
            prefix = "h " if split == HELD_OUT else ""
            out.append(
                Sequence(
                    f"{prefix}recover {name}", split, (person,), 2.7, covered=(0.5, 1.5), kind="recovery"
                )
            )
    return out


def troubles() -> list[Sequence]:
    """Bad input: each on frames of its own split."""
    out = []
    for split, build, move in (
        (TUNING, AVERAGE, _EX("signals", 61)),
        (HELD_OUT, BROAD, _EX("signals", 62)),
    ):
        prefix = "h " if split == HELD_OUT else ""
        for name in ("dropped", "slowed", "out_of_order", "frozen", "holed", "knocked"):
            out.append(
                Sequence(
                    f"{prefix}{name.replace('_', ' ')}",
                    split,
                    _one(build, move, (0.1, -2.6)),
                    4.0,
                    trouble=name,
                    kind="trouble",
                )
            )
    for split, prefix, builds, seed in (
        (TUNING, "", (TALL, AVERAGE), 0),
        (HELD_OUT, "h ", (SLIM, BROAD), 63),
    ):
        joined = (
            Person(builds[0], ((-2.4, _EX("touch", seed), (-0.55, -2.7), 0.0),), present=(0.4, 1e6)),
            Person(builds[1], ((-1.0, _EX("crossed", seed), (0.40, -2.72), -0.2),), present=(0.4, 1e6)),
        )
        out.append(Sequence(f"{prefix}joined", split, joined, 4.0, kind="trouble"))
    return out


_CLOSE: tuple[tuple[str, float], ...] = (
    ("folded", 0.0), ("akimbo", 0.4), ("jog", -0.2), ("jog", 0.7), ("guard", 0.1), ("guard", -0.5),
    ("belly", 0.0), ("lens", 0.0), ("lens", -0.35), ("chin", 0.2), ("chin and belly", -0.3), ("seat", 0.0),
    ("seat", 0.5),
)  # fmt: skip
"""Motions with limbs close to the trunk, and radians by which the performer is turned from the sensor."""
STOOL = (Box((-0.2, 0.0, -3.22), (0.2, 0.40, -2.82)),)
"""What a performer of average height at the usual place sits down on."""


def close_limbs() -> list[Sequence]:
    """Limbs close before the trunk: in either split of its own builds, seeds and sensors."""
    out = []
    for split, builds, first in ((CLOSE, (AVERAGE, SMALL, TALL, STOUT), 200), (OPENED, _OPENED_BUILDS, 900)):
        turn = 1.0 if split == CLOSE else -1.0
        for n, (name, yaw) in enumerate(_CLOSE):
            move = Move("close", name, first + n)
            build = builds[n % len(builds)]
            furniture = STOOL if name == "seat" and yaw == 0.0 else ()
            place = _HOME if furniture else (0.1 * turn, -2.5 - 0.15 * (n % 3))
            cast = _one(build, move, place, turn * yaw)
            sensor = ("oak-d", "kinect1")[(n + (split == OPENED)) % 2]
            title = f"{split[0]} {name} {n}"
            out.append(Sequence(title, split, cast, 4.5, sensor, furniture=furniture, seed=first + n))
    return out


_OPENED_BUILDS = (
    Proportions(1.83, 1.02, shoulders=1.08),
    Proportions(1.62, 0.93, hips=1.04, arms=1.03),
    Proportions(1.72, 1.15, legs=0.97),
)
"""Builds of no other split."""


_SEALED_CLOSE: tuple[tuple[str, float], ...] = (
    ("clap", 0.1), ("book", -0.25), ("watch", 0.3), ("hug", 0.0), ("guitar", 0.2), ("telephone", -0.4),
    ("folded", 0.3), ("jog", 0.25), ("guard", -0.2), ("belly", 0.35), ("chin", -0.3), ("lens", 0.2),
    ("akimbo", -0.5), ("seat", 0.3),
)  # fmt: skip
"""Motions with limbs close before the trunk, six of them in no other split, and radians from the sensor."""
_SEALED_BUILDS = (
    Proportions(1.78, 0.97, shoulders=1.04, arms=0.98),
    Proportions(1.64, 1.12, hips=1.08),
    Proportions(1.90, 1.05, legs=1.03),
    Proportions(1.55, 0.9, shoulders=0.95, legs=0.98),
)
"""Builds of no other split."""
_SEALED_PLACES = (("kinect1", (-0.15, -2.6)), ("oak-d", (-0.1, -2.8)), ("tof", (-0.05, -2.2)))
"""Sensors, and where performers stand before each."""
_YOUTH = Proportions(1.48, 0.95, shoulders=0.94)
"""A growing performer, of no other split."""


def sealed() -> list[Sequence]:
    """What is measured once: limbs close before the trunk, exercises, captures, two and three performers."""
    split, builds = SEALED, _SEALED_BUILDS
    out = []
    for n, (name, yaw) in enumerate(_SEALED_CLOSE):
        sensor, place = _SEALED_PLACES[n % 3]
        cast = _one(builds[n % 4], Move("close", name, 3000 + n), place, yaw)
        out.append(Sequence(f"x {name}", split, cast, 4.5, sensor, seed=3000 + n))
    jump, shuffle = "cmu_expmap/train_jumping_1.txt", f"{CMU}/CMU_Sample_05_01.bvh"
    aged, backwards = "bvh/xia_styles/old_13_000.bvh", f"{NAMCO}/dataset-1_walk-back_normal_001.bvh"
    cross = (
        Person(builds[0], ((0.2, _EX("stroll", 3021), (-1.5, -2.7), SIDE),)),
        Person(builds[1], ((0.2, _EX("stroll", 3022), (1.5, -3.35), -SIDE),)),
    )
    trio = (
        Person(builds[2], ((0.0, _EX("crossed", 3031), (-1.05, -2.9), 0.2),)),
        Person(_YOUTH, ((0.0, _EX("signals", 3032), (0.0, -2.7), 0.1),)),
        Person(builds[1], ((0.0, _EX("overhead", 3033), (1.0, -3.2), -0.2),)),
    )
    return [
        *out,
        Sequence("x overhead", split, _one(builds[3], _EX("overhead", 3041), (0.1, -2.7), 0.2), 4.5),
        Sequence("x crouch", split, _one(builds[0], _EX("crouch", 3042), yaw=-0.3), 4.5, "kinect1"),
        Sequence("x kneel", split, _one(builds[2], _EX("kneel", 3043), (0.1, -2.9), 0.4), 5.0),
        Sequence("x floor", split, _one(builds[1], _EX("floor", 3044), yaw=0.2), 5.0),
        Sequence("x turn", split, _one(_YOUTH, _EX("turn", 3045), (0.0, -2.5)), 6.0),
        Sequence("x one leg", split, _one(builds[3], _EX("one leg", 3046), yaw=-0.2), 4.5, "kinect1"),
        Sequence("x signals side", split, _one(builds[0], _EX("signals", 3047), yaw=SIDE), 4.0),
        Sequence("x jump", split, _one(builds[2], Move(jump, start=1.0), (0.0, -3.7)), 4.0),
        Sequence("x shuffle", split, _one(builds[3], Move(shuffle), (0.0, -3.0)), 3.0, "kinect1"),
        Sequence("x aged walk", split, _one(builds[1], Move(aged), (0.2, -3.6)), 3.0),
        Sequence("x backwards", split, _one(builds[0], Move(backwards), (0.0, -2.4)), 2.5),
        Sequence("x cross", split, cross, 5.0),
        Sequence("x three", split, trio, 4.0),
    ]


def sequences(split: str | None = None, only: str | None = None) -> list[Sequence]:
    """The sequences that can be made here: of a split (or all), whose names have ``only`` in them."""
    return [
        s
        for s in (*_accuracy(), *recoveries(), *troubles(), *close_limbs(), *sealed())
        if s.available and split in (None, s.split) and (only is None or only in s.name)
    ]
