"""Settings for how a surface follows its handles."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import setting


@dataclass(frozen=True)
class ArapSettings:
    """Settings for how a surface follows its handles."""

    iterations: int = setting(
        3, "Iterations a frame; with squash and stretch the last makes the pose.", low=1
    )
    squash_and_stretch: bool = setting(True, "Cells may scale, volume is kept; false is plain ARAP.")
    hold: float = setting(
        0.05, "How much cells resist a change of size in the shape state; 0 is the paper's eq. 4.", low=0.0
    )
    volume: float = setting(
        1.0, "How much of a closed surface's change of volume is taken back.", low=0.0, high=1.0
    )
    exaggeration: float = setting(
        1.0, "How far the volume follows squash and stretch: 0 not at all, 1 as it is.", low=0.0, high=5.0
    )
    most_stretch: float = setting(4.0, "No cell gets longer than this, or shorter than its inverse.", low=1.0)
    follow: float = setting(
        0.01,
        "A rigid motion of the handles that leaves at most this part moves the whole.",
        low=0.0,
        high=1.0,
    )
    threads: int = setting(
        0, "1, or 2 to share each cell's work with a second processor core; 0: whichever is faster now.",
        low=0, high=2,
    )  # fmt: skip
    coarse_above: int = setting(
        12_000, "A puppet's mesh of more vertices is solved coarsely, its detail carried along.", low=100
    )
    coarse_vertices: int = setting(8_000, "About how many vertices are solved then.", low=50)
    guide_vertices: int = setting(400, "About how many vertices of a puppet find the large bends.", low=20)
    most_vertices: int = setting(500_000, "Larger meshes are not solved whole.", low=3)
    most_carried: int = setting(20_000_000, "Larger meshes are refused.", low=3)
