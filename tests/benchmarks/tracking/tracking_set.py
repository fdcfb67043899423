"""The sequences on which tracking is measured: people, motions and sensors.

"tuning" sequences may be examined and tuned on. The reported figures are those of "held-out" sequences, which
have other motions and other builds. Recorded motions come from ENLIVEN_DATA. Without it the sequences that
need them are left out; generated motions still cover every kind of difficulty.
"""

from __future__ import annotations

from tracking_kept import (
    OPENED,
    SEALED_CONFIDENCE,
    SEALED_DECEMBER,
    SEALED_FLOOR,
    SEALED_TURNS,
    kept_sequences,
)
from tracking_motions import NAMES as TURN_NAMES
from tracking_scene import BACK, HOME, SIDE, Move, Person, Sequence, alone, exercise_move

from enliven_synthesis.body.performer import Proportions
from enliven_synthesis.sensor.scene import Box

TUNING, HELD_OUT = "tuning", "held-out"
CLOSE = "close"
"""Split with limbs close to the trunk, for tuning."""
TURNS = "turns"
"""Split with turns and floor work, for tuning."""
FLOOR = "floor"
"""Split with people that sit down on the floor and rest on it, for tuning."""

DESK = (
    Box((-0.75, 0.0, -1.95), (0.75, 0.74, -1.90)),
    Box((-0.80, 0.74, -2.15), (0.80, 0.78, -1.60)),
)
"""A desk with a closed front, in front of the performer."""
PILLAR = (Box((-0.16, 0.0, -2.0), (0.16, 2.7, -1.75)), Box((0.75, 0.0, -2.35), (1.30, 0.95, -1.95)))
"""A pillar and an armchair, between which a person walks."""

TALL = Proportions(1.88, 0.95, shoulders=1.05)
SMALL = Proportions(1.58, 1.0, shoulders=0.93, hips=1.08)
AVERAGE = Proportions(1.75)
STOUT = Proportions(1.70, 1.28, hips=1.1)
CHILD = Proportions(1.32, 0.98, shoulders=0.92, legs=0.96)
INFANT = Proportions(1.22, 1.06, shoulders=0.95)
LANKY = Proportions(1.93, 0.86, arms=1.06, legs=1.04)
BROAD = Proportions(1.80, 1.18, shoulders=1.12, legs=0.95)
SLIM = Proportions(1.66, 0.86, hips=1.05, arms=0.97)

CMU, NAMCO, OTHER = "bvh/cmu_mirrors", "bvh/bandai_namco", "bvh/other"


def _accuracy() -> list[Sequence]:
    """Returns sequences of one or more performers with a sensor without stream faults."""
    t, h, ex = TUNING, HELD_OUT, exercise_move
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
        # the tuning split
        Sequence("still", t, alone(AVERAGE, ex("still")), 3.0, kind="still"),
        Sequence("overhead", t, alone(TALL, ex("overhead"), (0.1, -2.9)), 5.0),
        Sequence("crouch", t, alone(AVERAGE, ex("crouch")), 4.5),
        Sequence("kneel", t, alone(SMALL, ex("kneel"), (-0.2, -2.5)), 5.0, "kinect1"),
        Sequence("floor", t, alone(AVERAGE, ex("floor")), 5.0),
        Sequence("turn", t, alone(STOUT, ex("turn")), 7.0),
        Sequence("one leg", t, alone(AVERAGE, ex("one leg")), 5.0, "kinect1"),
        Sequence("signals side", t, alone(SMALL, ex("signals"), yaw=SIDE), 4.0),
        Sequence("crossed tof", t, alone(AVERAGE, ex("crossed"), (0.0, -2.3)), 4.0, "tof"),
        Sequence("wave", t, alone(TALL, Move(wave)), 3.0, "kinect1"),
        Sequence("punch", t, alone(STOUT, Move(punch, stop=5.0)), 4.0),
        Sequence("childish walk", t, alone(AVERAGE, Move(stroll, start=1.0), (-0.3, -3.6)), 2.4),
        Sequence("call back", t, alone(SMALL, Move(call), yaw=BACK), 4.0),
        Sequence("cross", t, _crossing((AVERAGE, SMALL), 0), 5.0),
        Sequence("touch", t, _touching((TALL, SMALL), 0), 4.5),
        Sequence("three", t, _three(), 4.0),
        Sequence("four", t, _four_others(), 3.0),
        Sequence("five, in two rows", t, _two_rows(), 3.0),
        Sequence("desk", t, alone(AVERAGE, ex("signals", 3), (0.0, -2.7)), 4.0, furniture=DESK, told=True),
        Sequence("high camera", t, alone(TALL, ex("signals", 71), (0.2, -2.9)), 3.5, height=2.2, tilt=24.0),
        Sequence("child overhead", t, alone(INFANT, ex("overhead", 91), (0.1, -2.3)), 4.0),
        Sequence("child back", t, alone(INFANT, Move(wave), (0.0, -2.2), BACK), 2.5),
        Sequence("bow", t, alone(STOUT, Move(f"{NAMCO}/dataset-1_bow_normal_001.bvh")), 3.0),
        Sequence("walk side", t, alone(TALL, Move(side), (-1.0, -3.0), SIDE), 2.5, "kinect1"),
        Sequence("styled walk", t, alone(SMALL, Move(styled), (0.3, -3.6)), 3.0),
        # the held-out split
        Sequence("h still", h, alone(SLIM, ex("still", 5)), 4.0, kind="still"),
        Sequence("h overhead", h, alone(CHILD, ex("overhead", 11), (-0.1, -2.4)), 5.0),
        Sequence("h crouch", h, alone(LANKY, ex("crouch", 12), (0.2, -3.0)), 5.0, "kinect1"),
        Sequence("h kneel", h, alone(BROAD, ex("kneel", 13), yaw=0.6), 5.0),
        Sequence("h floor", h, alone(SLIM, ex("floor", 14), yaw=-0.4), 5.0),
        Sequence("h turn", h, alone(LANKY, ex("turn", 15), (0.0, -2.9)), 7.0),
        Sequence("h one leg", h, alone(SLIM, ex("one leg", 16), yaw=0.3), 5.0),
        Sequence("h signals side", h, alone(BROAD, ex("signals", 17), yaw=-SIDE), 4.0, "kinect1"),
        Sequence("h crossed tof", h, alone(BROAD, ex("crossed", 18), (0.1, -2.2)), 4.0, "tof"),
        Sequence("h traffic", h, alone(LANKY, Move(traffic, start=1.0), (0.0, -2.6)), 6.0),
        Sequence("h boxing", h, alone(BROAD, Move(boxing, start=8.0), (0.1, -2.6)), 5.0, "kinect1"),
        Sequence("h fall", h, alone(BROAD, Move(boxing, start=22.5), (0.0, -3.0)), 7.5),
        Sequence("h bends", h, alone(SLIM, Move(bends, start=3.0), (0.1, -2.7)), 6.0),
        Sequence("h jumps", h, alone(CHILD, Move(jumps, start=0.8), (0.6, -3.2), -0.6), 4.0),
        Sequence("h dance", h, alone(LANKY, Move(music, start=5.5), (-1.1, -3.0), SIDE), 3.4),
        Sequence("h walk in", h, alone(BROAD, Move(walk, start=0.4), (-0.4, -3.6)), 1.8, "kinect1"),
        Sequence("h eight", h, alone(SLIM, Move(eight, start=4.0), (1.0, -2.9)), 2.2),
        Sequence("h back", h, alone(CHILD, Move(traffic, start=12.0), (0.0, -2.4), BACK), 4.0),
        Sequence("h cross", h, _crossing((LANKY, SLIM), 21), 5.0, "kinect1"),
        Sequence("h touch", h, _touching((BROAD, SLIM), 22), 4.5),
        Sequence("h four", h, _four(), 4.0),
        Sequence("h leave", h, _leaving((LANKY, CHILD)), 9.0),
        Sequence("h high camera", h, alone(SLIM, ex("crossed", 72)), 3.5, "kinect1", height=2.3, tilt=26.0),
        Sequence("h low camera", h, alone(LANKY, ex("signals", 73)), 3.5, height=0.55, tilt=-6.0),
        Sequence("h pillar", h, alone(SLIM, ex("stroll", 24), (-1.7, -2.9), SIDE), 4.5, furniture=PILLAR),
    ]  # fmt: skip


def _crossing(builds: tuple[Proportions, Proportions], seed: int) -> tuple[Person, ...]:
    """Returns two people that walk across the image, one behind the other."""
    first, second = (exercise_move("stroll", seed), exercise_move("stroll", seed + 1 if seed else 0))
    return (
        Person(builds[0], ((0.2, first, (-1.6, -2.6), SIDE),)),
        Person(builds[1], ((0.2, second, (1.6, -3.3), -SIDE),)),
    )


def _touching(builds: tuple[Proportions, Proportions], seed: int) -> tuple[Person, ...]:
    """Returns two people side by side. One holds out a hand to the other."""
    return (
        Person(builds[0], ((0.0, exercise_move("touch", seed), (-0.55, -2.7), 0.0),)),
        Person(builds[1], ((0.0, exercise_move("crossed", seed), (0.42, -2.75), -0.2),)),
    )


def _three() -> tuple[Person, ...]:
    return (
        Person(AVERAGE, ((0.0, exercise_move("signals", 6), (-1.1, -3.1), 0.3),)),
        Person(TALL, ((0.0, exercise_move("one leg", 6), (0.0, -3.3), 0.0),)),
        Person(STOUT, ((0.0, exercise_move("crossed", 6), (1.0, -2.9), -0.3),)),
    )


def _four() -> tuple[Person, ...]:
    return (
        Person(BROAD, ((0.0, exercise_move("signals", 31), (-1.25, -3.2), 0.3),)),
        Person(SLIM, ((0.0, exercise_move("crossed", 32), (-0.35, -2.6), 0.1),)),
        Person(LANKY, ((0.0, exercise_move("overhead", 33), (0.55, -3.4), -0.2),)),
        Person(CHILD, ((0.0, exercise_move("one leg", 34), (1.1, -2.7), -0.4),)),
    )


def _four_others() -> tuple[Person, ...]:
    """Returns four people with positions different from those of "h four"."""
    return (
        Person(SMALL, ((0.0, exercise_move("crossed", 81), (-1.15, -2.6), 0.3),)),
        Person(TALL, ((0.0, exercise_move("signals", 82), (-0.45, -3.3), -0.1),)),
        Person(STOUT, ((0.0, exercise_move("still", 83), (0.35, -2.75), 0.2),)),
        Person(AVERAGE, ((0.0, exercise_move("signals", 84), (1.2, -3.25), -0.3),)),
    )


def _two_rows() -> tuple[Person, ...]:
    """Returns three people in front, and two behind them, in the gaps."""
    return (
        Person(SMALL, ((0.0, exercise_move("still", 85), (-0.95, -2.55), 0.2),)),
        Person(AVERAGE, ((0.0, exercise_move("crossed", 86), (0.05, -2.6), 0.0),)),
        Person(STOUT, ((0.0, exercise_move("still", 87), (1.0, -2.6), -0.2),)),
        Person(TALL, ((0.0, exercise_move("signals", 88), (-0.5, -3.5), 0.1),)),
        Person(Proportions(1.82), ((0.0, exercise_move("crossed", 89), (0.65, -3.55), -0.1),)),
    )


def _leaving(builds: tuple[Proportions, Proportions]) -> tuple[Person, ...]:
    """Returns one person that stays, and one that walks out of the image and comes back from the same
    side."""
    stay = exercise_move("crossed", 41)
    return (
        Person(builds[0], ((0.0, stay, (-0.6, -2.8), 0.2), (5.0, stay, (-0.6, -2.8), 0.2)), 0.5),
        Person(
            builds[1],
            (
                (0.3, exercise_move("stroll", 42), (0.5, -2.7), SIDE),
                (5.0, exercise_move("stroll", 43), (3.3, -2.7), -SIDE),
            ),
        ),
    )


_HARD: tuple[tuple[str, Move, float, float], ...] = (
    ("overhead", exercise_move("overhead"), 3.2, 0.0),
    ("floor", exercise_move("floor"), 2.1, 0.0),
    ("crouch", exercise_move("crouch"), 2.0, 0.0),
    ("kneel", exercise_move("kneel"), 2.4, 0.3),
    ("side", exercise_move("signals"), 1.3, SIDE),
    ("back", exercise_move("crossed"), 3.1, BACK),
    ("one leg", exercise_move("one leg"), 1.7, 0.0),
)
"""Name, exercise, its time in seconds, and yaw of the postures in which a performer is lost and must be found
again.
"""


def recoveries() -> list[Sequence]:
    """Returns sequences in which the lens is covered for a second while the performer moves into a hard
    posture.
    """
    out = []
    for split, builds, shift in ((TUNING, (AVERAGE, STOUT), 0), (HELD_OUT, (SLIM, BROAD, CHILD), 50)):
        for n, (name, move, at, yaw) in enumerate(_HARD):
            if split == TUNING and n % 2:
                continue
            seed = 0 if split == TUNING else shift + n
            held = Move("exercise", move.name, seed, held=at)
            person = Person(
                builds[n % len(builds)],
                ((0.0, exercise_move("still", seed), HOME, yaw), (1.0, held, HOME, yaw)),
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
    """Returns sequences with faulty input, each based on frames of the same split."""
    out = []
    for split, build, move in (
        (TUNING, AVERAGE, exercise_move("signals", 61)),
        (HELD_OUT, BROAD, exercise_move("signals", 62)),
    ):
        prefix = "h " if split == HELD_OUT else ""
        for name in ("dropped", "slowed", "out_of_order", "frozen", "holed", "knocked"):
            out.append(
                Sequence(
                    f"{prefix}{name.replace('_', ' ')}",
                    split,
                    alone(build, move, (0.1, -2.6)),
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
            Person(
                builds[0], ((-2.4, exercise_move("touch", seed), (-0.55, -2.7), 0.0),), present=(0.4, 1e6)
            ),
            Person(
                builds[1], ((-1.0, exercise_move("crossed", seed), (0.40, -2.72), -0.2),), present=(0.4, 1e6)
            ),
        )
        out.append(Sequence(f"{prefix}joined", split, joined, 4.0, kind="trouble"))
    return out


_CLOSE: tuple[tuple[str, float], ...] = (
    ("folded", 0.0), ("akimbo", 0.4), ("jog", -0.2), ("jog", 0.7), ("guard", 0.1), ("guard", -0.5),
    ("belly", 0.0), ("lens", 0.0), ("lens", -0.35), ("chin", 0.2), ("chin and belly", -0.3), ("seat", 0.0),
    ("seat", 0.5),
)  # fmt: skip
"""Motions with limbs close to the trunk, and the angle between performer and sensor, radians."""
STOOL = (Box((-0.2, 0.0, -3.22), (0.2, 0.40, -2.82)),)
"""A stool for a performer of average height at the usual position."""


def close_limbs() -> list[Sequence]:
    """Returns sequences with limbs close to the trunk. Each split has its own builds, seeds and sensors."""
    out = []
    for split, builds, first in ((CLOSE, (AVERAGE, SMALL, TALL, STOUT), 200), (OPENED, _OPENED_BUILDS, 900)):
        turn = 1.0 if split == CLOSE else -1.0
        for n, (name, yaw) in enumerate(_CLOSE):
            move = Move("close", name, first + n)
            build = builds[n % len(builds)]
            furniture = STOOL if name == "seat" and yaw == 0.0 else ()
            place = HOME if furniture else (0.1 * turn, -2.5 - 0.15 * (n % 3))
            cast = alone(build, move, place, turn * yaw)
            sensor = ("oak-d", "kinect1")[(n + (split == OPENED)) % 2]
            title = f"{split[0]} {name} {n}"
            out.append(Sequence(title, split, cast, 4.5, sensor, furniture=furniture, seed=first + n))
    return out


_OPENED_BUILDS = (
    Proportions(1.83, 1.02, shoulders=1.08),
    Proportions(1.62, 0.93, hips=1.04, arms=1.03),
    Proportions(1.72, 1.15, legs=0.97),
)
"""Builds of the opened split, which no other split uses."""


_TURNS_BUILDS = (
    Proportions(1.83, 1.04, shoulders=1.03, legs=1.01),
    Proportions(1.62, 0.94, hips=1.04),
    Proportions(1.72, 1.15, arms=0.98),
)
"""Builds of the sealed turns, which no other set uses."""


def turns() -> list[Sequence]:
    """Returns turns and floor work: every motion twice for each split, with different seeds, builds and
    yaws.
    """
    out = []
    for split, letter, builds, first in (
        (TURNS, "t", (AVERAGE, SMALL, TALL), 300),
        (SEALED_TURNS, "v", _TURNS_BUILDS, 9100),
    ):
        for n, name in enumerate(TURN_NAMES * 2):
            move = Move("turns", name, first + n)
            cast = alone(builds[n % 3], move, (0.1 * (-1) ** n, -2.8), 0.5 * (-1) ** (n // 2))
            sensor = ("oak-d", "kinect1")[n % 2]
            out.append(Sequence(f"{letter} {name} {n // 5 + 1}", split, cast, 4.5, sensor, seed=first + n))
    return out


_FLOOR_BUILDS = (
    Proportions(1.79, 0.96, shoulders=1.02, hips=1.02),
    Proportions(1.59, 1.06, legs=1.01),
    Proportions(1.87, 1.10, arms=1.02),
)
"""Builds of the sealed turns and floor work of November, which no other set uses."""
_DECEMBER_BUILDS = (
    Proportions(1.68, 0.98, arms=0.97, shoulders=1.04),
    Proportions(1.91, 1.01, legs=1.02),
    Proportions(1.56, 1.12, hips=1.05),
    Proportions(1.76, 0.90, arms=1.03),
)
"""Builds of the sealed turns and floor work of December, which no other set uses."""
_CONFIDENCE_BUILDS = (
    Proportions(1.81, 1.07, hips=0.98),
    Proportions(1.64, 1.03, legs=0.98, arms=1.02),
    Proportions(1.71, 0.93, shoulders=1.05),
    Proportions(1.58, 0.99, arms=0.99),
)
"""Builds of the films that were sealed until the confidence was fitted, which no other set uses."""
_SEATED = "seated"


def floor_work() -> list[Sequence]:
    """Returns sitting on the floor for tuning, and three sealed sets of all turns and floor work, with two or
    three films per kind."""
    kinds = [_SEATED if name == "sitting" else name for name in TURN_NAMES]
    out = []
    for split, letter, builds, first, names in (
        (FLOOR, "f", (STOUT, AVERAGE, TALL, SMALL), 600, [_SEATED] * 4),
        (SEALED_FLOOR, "z", _FLOOR_BUILDS, 12300, kinds * 2),
        (SEALED_DECEMBER, "q", _DECEMBER_BUILDS, 17500, kinds * 3),
        (SEALED_CONFIDENCE, "r", _CONFIDENCE_BUILDS, 23100, kinds * 3),
    ):
        for n, name in enumerate(names):
            move = Move(_SEATED if name == _SEATED else "turns", name, first + n)
            cast = alone(builds[n % len(builds)], move, (0.1 * (-1) ** n, -2.7), 0.6 * (-1) ** (n // 3))
            sensor = ("kinect1", "oak-d")[n % 2]
            seconds = 5.4 if name == _SEATED else 4.5
            out.append(
                Sequence(f"{letter} {name} {n // 5 + 1}{n % 5}", split, cast, seconds, sensor, seed=first + n)
            )
    return out


def sequences(split: str | None = None, only: str | None = None) -> list[Sequence]:
    """Returns the available sequences of a split (or all) with names that contain ``only``."""
    return [
        s
        for s in (
            *_accuracy(),
            *recoveries(),
            *troubles(),
            *close_limbs(),
            *turns(),
            *floor_work(),
            *kept_sequences(),
        )
        if s.available and split in (None, s.split) and (only is None or only in s.name)
    ]
