"""Sealed sets of synthetic sequences, on which the tracker is not tuned. Each is measured only once.

Each set contains limbs close to the trunk, exercises, captured motions, two people that cross, and three
people side by side. It has its own builds, seeds and captures. The second set is turned in the opposite
direction.
"""

from __future__ import annotations

from dataclasses import dataclass

from tracking_scene import SIDE, Move, Person, Sequence, alone, exercise_move

from enliven_synthesis.body.performer import Proportions

OPENED = "opened"
"""Split that was sealed until November 2026: limbs close to the trunk, the set "x"."""
SEALED = "sealed"
"""Split that is measured once, when tuning is finished.

Set "y" was measured on November 26, 2026. Before more tuning, call it opened and write another set.
"""
SEALED_TURNS = "turns, sealed"
"""Sealed split of turns and floor work, measured once on November 27, 2026, after the work on them."""
SEALED_FLOOR = "turns and floor work, sealed"
"""Sealed split of turns and floor work with other seeds, builds and yaws, in which people do not sink into
the floor.

It was measured once, on November 28, 2026.
"""
SEALED_DECEMBER = "turns and floor work, sealed in December"
"""Like :data:`SEALED_FLOOR`, with other seeds, builds and yaws.

It was measured once, on December 1, 2026, after mechanisms of the tracker had been removed.
"""
SEALED_CONFIDENCE = "turns and floor work, sealed until the confidence was fitted"
"""Like :data:`SEALED_FLOOR`, with other seeds, builds and yaws.

It was measured once, on December 1, 2026, after the confidence had been fitted again.
"""
_CLOSE: tuple[tuple[str, float], ...] = (
    ("clap", 0.1), ("book", -0.25), ("watch", 0.3), ("hug", 0.0), ("guitar", 0.2), ("telephone", -0.4),
    ("folded", 0.3), ("jog", 0.25), ("guard", -0.2), ("belly", 0.35), ("chin", -0.3), ("lens", 0.2),
    ("akimbo", -0.5), ("seat", 0.3),
)  # fmt: skip
"""Motions with limbs close to the trunk, six of which are in no tuning set, and yaws in radians."""
_SENSORS = (("kinect1", (-0.15, -2.6)), ("oak-d", (-0.1, -2.8)), ("tof", (-0.05, -2.2)))
"""Sensors, and the positions of performers in front of each."""


@dataclass(frozen=True)
class KeptSet:
    """A set of sequences.

    Attributes:
        letter: prefix of its names.
        first: the first seed.
        builds: four builds that no other set uses.
        youth: a growing performer that no other set uses.
        captures: four motions, with their names, positions in front of the sensor and seconds.
        turn: 1 or -1, the sign of all yaws and sideways positions.
        shift: offset by which the sensors are permuted.
    """

    split: str
    letter: str
    first: int
    builds: tuple[Proportions, ...]
    youth: Proportions
    captures: tuple[tuple[str, Move, tuple[float, float], float], ...]
    turn: float = 1.0
    shift: int = 0

    def sequences(self) -> list[Sequence]:
        """Returns all sequences of the set."""
        return [*self._close(), *self._exercises(), *self._captures(), *self._several()]

    def _close(self) -> list[Sequence]:
        out = []
        for n, (name, yaw) in enumerate(_CLOSE):
            sensor, (x, z) = _SENSORS[(n + self.shift) % 3]
            seed = self.first + n
            cast = alone(self.builds[n % 4], Move("close", name, seed), (self.turn * x, z), self.turn * yaw)
            out.append(Sequence(f"{self.letter} {name}", self.split, cast, 4.5, sensor, seed=seed))
        return out

    def _exercises(self) -> list[Sequence]:
        a, b, c, d = self.builds
        exercises: tuple[tuple[str, str, Proportions, tuple[float, float], float, float, str], ...] = (
            ("overhead", "overhead", d, (0.1, -2.7), 0.2, 4.5, "oak-d"),
            ("crouch", "crouch", a, (0.0, -2.7), -0.3, 4.5, "kinect1"),
            ("kneel", "kneel", c, (0.1, -2.9), 0.4, 5.0, "oak-d"),
            ("floor", "floor", b, (0.0, -2.7), 0.2, 5.0, "oak-d"),
            ("turn", "turn", self.youth, (0.0, -2.5), 0.0, 6.0, "oak-d"),
            ("one leg", "one leg", d, (0.0, -2.7), -0.2, 4.5, "kinect1"),
            ("signals side", "signals", a, (0.0, -2.7), SIDE, 4.0, "oak-d"),
        )
        return [
            Sequence(
                f"{self.letter} {name}",
                self.split,
                alone(build, self._move(move, 41 + n), (self.turn * x, z), self.turn * yaw),
                seconds,
                sensor,
            )
            for n, (name, move, build, (x, z), yaw, seconds, sensor) in enumerate(exercises)
        ]

    def _captures(self) -> list[Sequence]:
        a, b, c, d = self.builds
        return [
            Sequence(f"{self.letter} {name}", self.split, alone(build, move, place), seconds, sensor)
            for (name, move, place, seconds), build, sensor in zip(
                self.captures, (c, d, b, a), ("oak-d", "kinect1", "oak-d", "oak-d"), strict=True
            )
        ]

    def _several(self) -> list[Sequence]:
        a, b, c, _ = self.builds
        turn = self.turn
        cross = (
            Person(a, ((0.2, self._move("stroll", 21), (-1.5 * turn, -2.7), SIDE * turn),)),
            Person(b, ((0.2, self._move("stroll", 22), (1.5 * turn, -3.35), -SIDE * turn),)),
        )
        trio = (
            Person(c, ((0.0, self._move("crossed", 31), (-1.05 * turn, -2.9), 0.2 * turn),)),
            Person(self.youth, ((0.0, self._move("signals", 32), (0.0, -2.7), 0.1 * turn),)),
            Person(b, ((0.0, self._move("overhead", 33), (1.0 * turn, -3.2), -0.2 * turn),)),
        )
        return [
            Sequence(f"{self.letter} cross", self.split, cross, 5.0),
            Sequence(f"{self.letter} three", self.split, trio, 4.0),
        ]

    def _move(self, name: str, n: int) -> Move:
        return exercise_move(name, self.first + n)


_X = KeptSet(
    split=OPENED,
    letter="x",
    first=3000,
    builds=(
        Proportions(1.78, 0.97, shoulders=1.04, arms=0.98),
        Proportions(1.64, 1.12, hips=1.08),
        Proportions(1.90, 1.05, legs=1.03),
        Proportions(1.55, 0.9, shoulders=0.95, legs=0.98),
    ),
    youth=Proportions(1.48, 0.95, shoulders=0.94),
    captures=(
        ("jump", Move("cmu_expmap/train_jumping_1.txt", start=1.0), (0.0, -3.7), 4.0),
        ("shuffle", Move("bvh/cmu_mirrors/CMU_Sample_05_01.bvh"), (0.0, -3.0), 3.0),
        ("aged walk", Move("bvh/xia_styles/old_13_000.bvh"), (0.2, -3.6), 3.0),
        ("backwards", Move("bvh/bandai_namco/dataset-1_walk-back_normal_001.bvh"), (0.0, -2.4), 2.5),
    ),
)
_Y = KeptSet(
    split=SEALED,
    letter="y",
    first=5000,
    builds=(
        Proportions(1.81, 1.08, shoulders=1.02, hips=1.03),
        Proportions(1.60, 0.98, arms=0.97, legs=1.02),
        Proportions(1.86, 0.92, shoulders=1.03, arms=1.03),
        Proportions(1.68, 1.2, hips=1.05, legs=0.96),
    ),
    youth=Proportions(1.42, 1.0, shoulders=0.96),
    captures=(
        ("run on", Move("cmu_expmap/train_running_1.txt", start=0.5), (0.0, -3.4), 3.0),
        ("stroll on", Move("cmu_expmap/test_walking_1.txt", start=1.0), (0.0, -3.6), 3.0),
        ("plain walk", Move("bvh/xia_styles/neutral_01_000.bvh"), (-0.2, -3.6), 3.0),
        ("run", Move("bvh/bandai_namco/dataset-1_run_normal_001.bvh"), (0.1, -3.6), 2.0),
    ),
    turn=-1.0,
    shift=1,
)


def kept_sequences() -> list[Sequence]:
    """Returns the opened and the sealed sequences."""
    return [*_X.sequences(), *_Y.sequences()]
