"""The settings of baking, and the error of a baked surface."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import parameter

MAX_CACHED_FRAMES_MB = 256.0
"""Maximum memory for solved frames, in megabytes. Longer motions are solved again when they are needed."""


@dataclass(frozen=True)
class BakeSettings:
    """Settings for the accuracy and the cost of a bake."""

    rms: float = parameter(
        0.001, "Maximum accepted root mean square error.", unit="fraction of the mesh's size", low=0.0
    )
    worst: float = parameter(
        0.01,
        "Maximum accepted error of any vertex in any frame.",
        unit="fraction of the mesh's size",
        low=0.0,
    )
    nodes: int = parameter(96, "Maximum number of transforms, including control points.", low=1, high=1024)
    first: int = parameter(32, "Initial number of transforms.", low=1, high=1024)
    targets: int = parameter(64, "Maximum number of morph targets (blend shapes).", low=1, high=512)
    rounds: int = parameter(
        4, "Number of alternating fits of weights and transforms after each addition.", low=1, high=100
    )
    smooth: float = parameter(
        0.006,
        "Error accepted for weights that are similar to those of neighbouring vertices.",
        unit="fraction of the mesh's size",
        low=0.0,
        high=1.0,
    )
    rigid: float = parameter(
        0.005,
        "Strength with which transforms stay rotations if the surface does not determine them.",
        low=1e-9,
        high=10.0,
    )
    frames: int = parameter(
        120,
        "Number of most different frames used for the fit. The error is measured in all frames.",
        low=2,
        high=5000,
    )
    keys: float = parameter(
        0.0005,
        "Additional error allowed for removing animation keys.",
        unit="fraction of the mesh's size",
        low=0.0,
    )


@dataclass(frozen=True)
class BakeError:
    """The difference between a baked surface and the solved one, over all vertices of all frames.

    Attributes:
        rms: root mean square error in metres.
        worst: maximum error in metres, of any vertex in any frame.
        frame: the frame with the maximum error.
        vertex: the vertex with the maximum error.
        size: metres, the diagonal of the mesh's bounding box at rest.
    """

    rms: float
    worst: float
    frame: int
    vertex: int
    size: float

    def __str__(self) -> str:
        percent = 100.0 / self.size if self.size > 0 else 0.0
        return (
            f"off by {1000 * self.rms:.2f} mm ({self.rms * percent:.3f} % of the mesh's size) as a root mean "
            f"square, and by at most {1000 * self.worst:.2f} mm ({self.worst * percent:.2f} %) in "
            f"frame {self.frame}"
        )
