"""A pose stream: the recorded or keyframed motion of a deformation graph's nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float, freeze
from enliven.document.keys import KEY_STEP, MotionKey, key_values, sort_keys
from enliven.errors import InputError
from enliven.rotation import from_rotation_vector, nearest_rotation, to_matrix


@dataclass(frozen=True, eq=False)
class PoseStream:
    """The recorded motion of a deformation graph's nodes. Like a take, it is immutable.

    Attributes:
        id: its name in the project.
        linear: (F, N, 3, 3) float64 linear maps of the nodes, which are nearly rotations.
        positions: (F, N, 3) float64 metres, the positions of the nodes in the world.
        step: seconds from one frame to the next.
        keys: the keys that the frames were computed from, in the order of time. Empty for a performance.
        follow: (N, 4) for a stream of keys: the weight with which each node follows the keys (1 for the node
            with the keys), and the gradient (3,) of this weight per metre; see :func:`make_keyed_stream`.

    Raises:
        InputError: if the shapes of the arrays are inconsistent or values are not finite.
    """

    id: str
    linear: Float
    positions: Float
    step: float
    keys: tuple[MotionKey, ...] = ()
    follow: Float = field(default_factory=lambda: np.zeros((0, 4)))

    def __post_init__(self) -> None:
        freeze(self, "linear", "positions", "follow")
        frames, nodes = self.positions.shape[:2] if self.positions.ndim == 3 else (0, 0)
        problem = ""
        if frames == 0 or nodes == 0:
            problem = "the recording has no frames or no nodes"
        elif self.positions.shape != (frames, nodes, 3) or self.linear.shape != (frames, nodes, 3, 3):
            problem = (
                f"the arrays of the recording have wrong shapes: linear maps {self.linear.shape}, "
                f"positions {self.positions.shape}"
            )
        elif not (np.isfinite(self.linear).all() and np.isfinite(self.positions).all()):
            problem = "a node position or a linear map of the recording is not a finite number"
        elif not 0.0 < self.step <= 10.0:
            problem = f"the frame interval {self.step} s is not above 0 s and at most 10 s"
        elif self.follow.shape != ((nodes if self.keys else 0), 4) or not np.isfinite(self.follow).all():
            problem = (
                f"the weights of {len(self.keys)} keys have the shape {self.follow.shape}, but the "
                f"recording has {nodes} nodes"
            )
        if problem:
            raise InputError(problem, where=f"stream {self.id!r}", remedy="Record the motion again.")

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self.positions) - 1) * self.step

    @property
    def keyed(self) -> int:
        """The number of the node with the keys, or -1 without keys."""
        return int(self.follow[:, 0].argmax()) if self.keys else -1


def make_keyed_stream(stream_id: str, rest: Float, follow: Float, keys: Sequence[MotionKey]) -> PoseStream:
    """Builds a stream of nodes that follow the keys of one of them, while the rest of the mesh stays at rest.

    Let R be the rotation and d the displacement of the keys at a time. Let s be the weight of a node at r,
    and k the position of the node with the keys. The node at r moves to r + s ((R - I) (r - k) + d). Its
    linear map is the rotation nearest to the gradient of this position, so that the mesh bends without shear.

    Args:
        rest: (N, 3) metres, the nodes at rest.
        follow: (N, 4) the weights s and their gradients, as in :class:`PoseStream`.

    Raises:
        InputError: without a key, or if two keys are on the same frame.
    """
    ordered_keys = sort_keys(keys, f"stream {stream_id!r}")
    values = key_values(ordered_keys, np.arange(round(ordered_keys[-1].second / KEY_STEP) + 1) * KEY_STEP)
    rotations_minus_identity = to_matrix(from_rotation_vector(np.radians(values[:, :3]))) - np.eye(3)
    weights, slopes = follow[:, 0], follow[:, 1:]
    arms = rest - rest[int(weights.argmax())]
    displacement = np.einsum("tij,nj->tni", rotations_minus_identity, arms) + values[:, None, 3:]
    gradient = (
        np.eye(3)
        + weights[:, None, None] * rotations_minus_identity[:, None]
        + displacement[..., None] * slopes[:, None, :]
    )
    positions = rest + weights[:, None] * displacement
    return PoseStream(stream_id, nearest_rotation(gradient), positions, KEY_STEP, ordered_keys, follow)
