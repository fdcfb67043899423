"""Measures how well human-like meshes keep their performer's heading, and their position when they first
appear.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from turning_people import FRAME_RATE_HZ, deviations_deg, headings_on_stage, spinning_people

from enliven.arrays import Float
from enliven.meshes import Mesh
from enliven.person import Joint
from enliven.possession import ActorSettings
from enliven_edge.stage.character_setup import create_mesh_actor

_HELD_FROM_S = 2.5
"""Time at which the performer is attached, seconds. The performer has turned between detection and
attachment.
"""
NOISE_M = 0.004
"""Standard deviation of a tracked hip's position, metres."""


@dataclass(frozen=True)
class Turning:
    """The result of one mesh in one film.

    Attributes:
        off_deg: (F,) deviation of the difference between mesh and performer heading from its mean, degrees.
        first_m: distance on the floor between the mesh's hips in the first frame and their correct position,
            metres.
    """

    off_deg: Float
    first_m: float


def measure_turning(mesh: Mesh, how: str, seed: int, noise_m: float = NOISE_M) -> Turning:
    """Measures a human-like mesh while a simulated person spins before and during possession."""
    settings = ActorSettings(how=how, travel=1.0)
    actor = create_mesh_actor(mesh, "it", 128, settings)
    film = spinning_people(seed, noise_m=noise_m)
    gaps, places = headings_on_stage(actor, film, round(_HELD_FROM_S * FRAME_RATE_HZ))
    apart = (places[0] - film[0].joints[Joint.HIP_CENTER])[[0, 2]]
    aside = 0.0 if how == "inside" else settings.aside
    return Turning(deviations_deg(gaps), abs(float(np.linalg.norm(apart)) - aside))
