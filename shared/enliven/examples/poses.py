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
"""Poses that differ by less than this fraction of their size count as equal."""
_ERROR_PLACE = "examples"


@dataclass(frozen=True, eq=False)
class Examples:
    """P pairs of a joint and a control point, with their positions in n example poses.

    Attributes:
        joints: (P,) names of the performer's joints.
        points: (P,) names of the mesh's control points, without repetition.
        sources: (n, P, 3) metres, joints in the performer's body frame (:mod:`enliven.examples.performer`).
        targets: (n, P, 3) metres, control points in the mesh's own frame.

    Raises:
        InputError: if there are fewer than two examples, equal examples, or numbers that are not finite. The
            message names the examples.
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
        """Root-mean-square distance of the joints from the root, metres."""
        return _pose_size(self.sources)

    @cached_property
    def target_size(self) -> float:
        """Root-mean-square distance of the control points from their centre, metres."""
        return _pose_size(self.targets - self.targets.mean((0, 1)))

    def find_point(self, name: str) -> int:
        """Returns the number of a control point.

        Raises:
            InputError: if it does not exist. The message lists the existing control points.
        """
        if name not in self.points:
            advice = f"Known control points: {', '.join(self.points)}."
            raise InputError(f"the control point {name!r} does not exist", where=_ERROR_PLACE, remedy=advice)
        return self.points.index(name)

    def _check_shapes(self) -> None:
        pairs, count = len(self.points), len(self.sources)
        shape = (count, pairs, 3)
        if pairs == 0 or len(self.joints) != pairs:
            problem = (
                f"the number of joints is {len(self.joints)}, but the number of control points is {pairs}"
            )
            raise InputError(problem, where=_ERROR_PLACE, remedy="Pair each control point with one joint.")
        if len(set(self.points)) != pairs:
            repeated_names = sorted({name for name in self.points if self.points.count(name) > 1})
            raise InputError(
                f"control points occur more than once: {', '.join(repeated_names)}", where=_ERROR_PLACE
            )
        if self.sources.shape != shape or self.targets.shape != shape:
            problem = (
                f"the poses have the shapes {self.sources.shape} and {self.targets.shape}, expected (n, "
                f"{pairs}, 3)"
            )
            raise InputError(
                problem, where=_ERROR_PLACE, remedy="Pass n poses of the performer and n poses of the mesh."
            )
        if count < 2:
            raise InputError(
                f"the number of examples is {count}, but at least 2 are needed",
                where=_ERROR_PLACE,
                remedy="Pose one more example.",
            )

    def _check_values(self) -> None:
        is_bad = ~(np.isfinite(self.sources) & np.isfinite(self.targets)).all(2)
        if is_bad.any():
            example, pair = np.argwhere(is_bad)[0]
            problem = (
                f"example {example} has a position that is not finite, at the control point "
                f"{self.points[pair]!r}"
            )
            raise InputError(problem, where=_ERROR_PLACE, remedy="Pose this example again.")
        for a in range(len(self)):
            distances = np.sqrt(((self.sources[a + 1 :] - self.sources[a]) ** 2).mean((1, 2)))
            equal_examples = np.flatnonzero(distances <= _SAME_POSE_TOLERANCE * max(self.source_size, 1e-12))
            if len(equal_examples):
                problem = (
                    f"examples {a} and {a + 1 + int(equal_examples[0])} have the same pose of the performer"
                )
                raise InputError(
                    problem,
                    where=_ERROR_PLACE,
                    remedy="Remove one of these examples, or choose another frame for it.",
                )


def drop_repeated_poses(sources: Float) -> list[int]:
    """Returns the indices of the poses (n, P, 3) that do not repeat an earlier pose."""
    kept_numbers: list[int] = []
    tolerance = _SAME_POSE_TOLERANCE * max(_pose_size(sources), 1e-12)
    for number, pose in enumerate(sources):
        if all(np.sqrt(((pose - sources[other]) ** 2).mean()) > tolerance for other in kept_numbers):
            kept_numbers.append(number)
    return kept_numbers


def _pose_size(poses: Float) -> float:
    """Computes the root-mean-square length of (n, P, 3), or 1 if all are zero."""
    return float(np.sqrt((poses**2).sum(2).mean())) or 1.0
