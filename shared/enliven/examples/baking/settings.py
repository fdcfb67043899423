"""The settings of a bake, and its error."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import setting


@dataclass(frozen=True)
class BakeSettings:
    """Settings for the accuracy and the cost of a bake."""

    rms: float = setting(
        0.001, "Root mean square error that is good enough.", unit="share of the mesh's size", low=0.0
    )
    worst: float = setting(
        0.01,
        "Error of any vertex in any frame that is good enough.",
        unit="share of the mesh's size",
        low=0.0,
    )
    nodes: int = setting(96, "Transforms at most; control points count.", low=1, high=1024)
    first: int = setting(32, "Transforms to begin with.", low=1, high=1024)
    targets: int = setting(64, "Morph targets at most.", low=1, high=512)
    rounds: int = setting(
        4, "How often weights and transforms are fitted in turn, after each addition.", low=1, high=100
    )
    candidates: int = setting(8, "Transforms, of those around a vertex, that it may follow.", low=4, high=16)
    smooth: float = setting(
        0.006,
        "Error that a vertex takes rather than be weighted wholly otherwise than its neighbours.",
        unit="share of the mesh's size",
        low=0.0,
        high=1.0,
    )
    rigid: float = setting(
        0.005,
        "How strongly a transform is kept a rotation where the surface does not tell.",
        low=1e-9,
        high=10.0,
    )
    frames: int = setting(
        120, "Frames that are fitted to, those farthest from one another; measured are all.", low=2, high=5000
    )
    kept: float = setting(256.0, "Solved frames are kept while they need no more.", unit="MB", low=0.0)
    keys: float = setting(
        0.0005,
        "Error that leaving out keys of the animation may add.",
        unit="share of the mesh's size",
        low=0.0,
    )


@dataclass(frozen=True)
class BakeError:
    """The difference between a baked surface and the solved one, over all vertices of all frames.

    Attributes:
        rms: metres, root mean square.
        worst: metres, of any vertex in any frame.
        frame: the frame with the worst error.
        vertex: the vertex of the mesh with the worst error.
        size: metres, the diagonal of the mesh's bounding box at rest.
    """

    rms: float
    worst: float
    frame: int
    vertex: int
    size: float

    def __str__(self) -> str:
        share = 100.0 / self.size if self.size > 0 else 0.0
        return (
            f"off by {1000 * self.rms:.2f} mm ({self.rms * share:.3f} % of its size) as a root mean square, "
            f"at most {1000 * self.worst:.2f} mm ({self.worst * share:.2f} %) in frame {self.frame}"
        )
