"""Example poses: positions of a performer's joints, and the corresponding positions of a mesh's control
points.

Examples(joints, points, sources (n, P, 3), targets (n, P, 3))
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError

_SAME_POSE_TOLERANCE = 1e-6
"""Poses that differ by less than this fraction of their size are equal."""
_ERROR_PLACE = "examples"


@dataclass(frozen=True, eq=False)
class Examples:
    """Pairs of a joint and a control point with n example poses of the P pairs.

    Attributes:
        joints: (P,) names of the performer's joints.
        points: (P,) names of the mesh's control points, without repetition.
        sources: (n, P, 3) metres, joints in the performer's body frame (:mod:`enliven.examples.performer`).
        targets: (n, P, 3) metres, control points in the mesh's own frame.

    Raises:
        InputError: for fewer than two examples, equal examples, or numbers that are not finite. The message
            names them.
    """

    joints: tuple[str, ...]
    points: tuple[str, ...]
    sources: Float
    targets: Float

    def __post_init__(self) -> None:
        for name in ("joints", "points"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        for name in ("sources", "targets"):
            array = np.array(getattr(self, name), np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        self._check_shapes()
        self._check_values()

    def __len__(self) -> int:
        return len(self.sources)

    @cached_property
    def source_size(self) -> float:
        """Metres: root-mean-square distance of the joints from the root."""
        return _pose_size(self.sources)

    @cached_property
    def target_size(self) -> float:
        """Metres: root-mean-square distance of the control points from their centre."""
        return _pose_size(self.targets - self.targets.mean((0, 1)))

    def point(self, name: str) -> int:
        """Returns the number of a control point.

        Raises:
            InputError: if it does not exist; the message lists the existing ones.
        """
        if name not in self.points:
            mend = f"Known: {', '.join(self.points)}."
            raise InputError(f"the control point {name!r} does not exist", where=_ERROR_PLACE, mend=mend)
        return self.points.index(name)

    def _check_shapes(self) -> None:
        pairs, count = len(self.points), len(self.sources)
        shape = (count, pairs, 3)
        if pairs == 0 or len(self.joints) != pairs:
            problem = f"{len(self.joints)} joints are paired with {pairs} control points"
            raise InputError(problem, where=_ERROR_PLACE, mend="Pair each control point with one joint.")
        if len(set(self.points)) != pairs:
            twice = sorted({name for name in self.points if self.points.count(name) > 1})
            raise InputError(f"control points occur twice: {', '.join(twice)}", where=_ERROR_PLACE)
        if self.sources.shape != shape or self.targets.shape != shape:
            problem = f"poses {self.sources.shape} and {self.targets.shape} of {pairs} pairs"
            raise InputError(problem, where=_ERROR_PLACE, mend="Give (n, P, 3) of both.")
        if count < 2:
            raise InputError(
                f"there is {count} example, two are needed", where=_ERROR_PLACE, mend="Pose one more."
            )

    def _check_values(self) -> None:
        bad = ~(np.isfinite(self.sources) & np.isfinite(self.targets)).all(2)
        if bad.any():
            example, pair = np.argwhere(bad)[0]
            problem = f"example {example} is not finite at {self.points[pair]!r}"
            raise InputError(problem, where=_ERROR_PLACE, mend="Pose it again.")
        for a in range(len(self)):
            distances = np.sqrt(((self.sources[a + 1 :] - self.sources[a]) ** 2).mean((1, 2)))
            same = np.flatnonzero(distances <= _SAME_POSE_TOLERANCE * max(self.source_size, 1e-12))
            if len(same):
                problem = f"examples {a} and {a + 1 + int(same[0])} have the same pose of the performer"
                raise InputError(
                    problem, where=_ERROR_PLACE, mend="Remove one, or choose another frame for it."
                )


def drop_repeated_poses(sources: Float) -> list[int]:
    """Returns the poses (n, P, 3) that do not repeat an earlier one."""
    kept: list[int] = []
    least = _SAME_POSE_TOLERANCE * max(_pose_size(sources), 1e-12)
    for number, pose in enumerate(sources):
        if all(np.sqrt(((pose - sources[other]) ** 2).mean()) > least for other in kept):
            kept.append(number)
    return kept


def _pose_size(poses: Float) -> float:
    """Computes the root-mean-square length of (n, P, 3), or 1 if all are zero."""
    return float(np.sqrt((poses**2).sum(2).mean())) or 1.0
