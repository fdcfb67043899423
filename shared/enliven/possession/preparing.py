"""A mesh from a file, made ready to be possessed."""

from __future__ import annotations

import logging

import numpy as np

from enliven.meshes import Mesh, fit_height, refine
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.standing import fit_standing_person

log = logging.getLogger(__name__)

_HEIGHT = 1.75
"""Metres: meshes are brought to a person's height, from which the performer's own is a small factor."""
_LONGEST_EDGE = 0.04
"""Metres: longer edges are split, as a triangle must be narrower than a limb to bend with it."""


def prepared(mesh: Mesh, settings: ActorSettings) -> tuple[Mesh, float]:
    """Returns an upright mesh as it goes on stage, and how many metres as modelled are one metre of it.

    One that meets its performer is scaled to a person's height, moved to where a standing person fits into
    it, and refined where its triangles are too large to bend; one that stays fixed is taken as modelled.
    """
    if settings.place == "fixed":
        return mesh, 1.0
    size = float(np.ptp(mesh.vertices[:, 1])) / _HEIGHT
    mesh = fit_height(mesh, _HEIGHT)
    if settings.stand == "fitted":
        mesh, fit = fit_standing_person(mesh)
        log.info("%s: moved to where a standing person fits into it (%.0f %%)", mesh.name, 100 * fit)
    return refine(mesh, _LONGEST_EDGE), size
