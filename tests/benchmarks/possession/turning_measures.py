"""Measures how well human-like meshes keep their performer's heading, and where they first appear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from turning_people import FRAME_RATE_HZ, deviations_deg, headings_on_stage, spinning_people

from enliven.arrays import Float
from enliven.meshes import Mesh
from enliven.person import Joint
from enliven.possession import ActorSettings
from enliven_edge.stage.casting import cast_mesh

_HELD_FROM_S = 2.5
"""Seconds after which the performer takes hold: by then they have turned since they were first seen."""
_NOISE_M = 0.004
"""Metres: how much a tracked hip shakes."""


@dataclass(frozen=True)
class Turning:
    """Result of one mesh in one film.

    Attributes:
        off_deg: (F,) degrees by which the heading of the mesh's hips, less the performer's, is off its mean.
        first_m: metres over the floor from the mesh's hips, in the first frame, to where they belong.
    """

    off_deg: Float
    first_m: float


def measure_turning(mesh: Mesh, how: str, seed: int, noise_m: float = _NOISE_M) -> Turning:
    """Lets a made-up person spin before, and in, a mesh that is built as a person."""
    settings = ActorSettings(how=how, travel=1.0)  # type: ignore[arg-type]
    actor = cast_mesh(mesh, "it", 128, settings)
    film = spinning_people(seed, noise_m=noise_m)
    gaps, places = headings_on_stage(actor, film, round(_HELD_FROM_S * FRAME_RATE_HZ))
    apart = (places[0] - film[0].joints[Joint.HIP_CENTER])[[0, 2]]
    aside = 0.0 if how == "inside" else settings.aside
    return Turning(deviations_deg(gaps), abs(float(np.linalg.norm(apart)) - aside))
