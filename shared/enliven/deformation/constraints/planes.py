"""Constraints on points of a mesh: targets, and soft planes (observed surface, floor, other limbs)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from enliven.arrays import Bool, Float, Int32
from enliven.errors import InputError


class PointConstraints(Protocol):
    """Protocol of points in the rest space, with the nodes that move them. An Attachment implements it."""

    @property
    def points(self) -> Float:
        """(L, 3) metres, the points at rest."""

    @property
    def node_indices(self) -> Int32:
        """(L, 4) the nodes that move each point."""

    @property
    def node_weights(self) -> Float:
        """(L, 4) weights that sum to one."""


@dataclass(frozen=True)
class PlaneConstraints:
    """Points of a mesh, and the planes that pull them: energy w (n·φ(p) − b)² each. They may change every
    frame.

    Attributes:
        points: (M, 3) metres, the points p in the mesh's rest space.
        node_indices: (M, 4) int32 the nodes that move each point.
        node_weights: (M, 4) weights of these nodes; they sum to one.
        normals: (M, 3) unit normals n of the planes, in the frame of the targets.
        offsets: (M,) metres, the offsets b of the planes from the origin.
        weights: (M,) the weights w, not negative; 0 disables a plane. The solver multiplies them by its own
            weight.
        one_sided: (M,) True if a plane only pushes, that is, if it is active only while n·φ(p) < b.
    """

    points: Float
    node_indices: Int32
    node_weights: Float
    normals: Float
    offsets: Float
    weights: Float
    one_sided: Bool

    def __post_init__(self) -> None:
        count = len(self.points)
        shapes = {
            "points": (count, 3),
            "node_indices": (count, 4),
            "node_weights": (count, 4),
            "normals": (count, 3),
            "offsets": (count,),
            "weights": (count,),
            "one_sided": (count,),
        }
        for name, shape in shapes.items():
            actual = np.shape(getattr(self, name))
            if actual != shape:
                raise InputError(
                    f"the array of {name} has the shape {actual} instead of {shape}",
                    where="plane constraints",
                )

    def __len__(self) -> int:
        return len(self.points)
