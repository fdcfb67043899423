"""Settings for how a surface follows its handles."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import data_field, setting


@dataclass(frozen=True)
class ArapSettings:
    """Settings for how a surface follows its handles."""

    iterations: int = data_field(
        3,
        "Number of solver iterations per frame. With squash and stretch, the last iteration "
        "computes the pose.",
        low=1,
    )
    squash_and_stretch: bool = setting(
        True,
        "Parts of the mesh may stretch, but the volume stays the same. If off, the "
        "deformation is plain ARAP.",
    )
    hold: float = setting(
        0.05, "Resistance of mesh cells to changes of size. 0 follows eq. 4 of the paper.", low=0.0
    )
    volume: float = setting(
        1.0, "Fraction of a closed surface's change of volume that is corrected.", low=0.0, high=1.0
    )
    exaggeration: float = setting(
        1.0, "Strength of squash and stretch: 0 is off, 1 is natural, more exaggerates.", low=0.0, high=5.0
    )
    most_stretch: float = data_field(
        4.0, "Maximum stretch factor of a mesh cell. The minimum factor is its inverse.", low=1.0
    )
    follow: float = data_field(
        0.01,
        "If the handles move like a rigid body up to this relative error, the whole mesh "
        "first moves rigidly with them.",
        low=0.0,
        high=1.0,
    )
    threads: int = data_field(
        0, "Number of processor cores for the solver: 1 or 2. 0 chooses the faster number "
"automatically.",
        low=0, high=2,
    )  # fmt: skip
    coarse_above: int = data_field(
        12_000,
        "Puppet meshes with more vertices are solved on a reduced mesh, and the fine detail "
        "follows the reduced mesh.",
        low=100,
    )
    coarse_vertices: int = data_field(8_000, "Approximate number of vertices of the reduced mesh.", low=50)
    guide_vertices: int = data_field(
        400, "Approximate number of vertices of the coarse mesh that estimates large bends.", low=20
    )
    most_vertices: int = data_field(
        500_000, "Maximum number of vertices of a mesh that is solved without reduction.", low=3
    )
    most_carried: int = data_field(
        20_000_000, "Maximum number of vertices of a mesh. Larger meshes are refused.", low=3
    )
