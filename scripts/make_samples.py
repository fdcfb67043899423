"""Writes the sample characters and motions that are shipped: .venv/bin/python scripts/make_samples.py

Coordinates are rounded to whole steps, and neighbouring values differ little. The files store the differences
(delta encoding), so they are small.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from sample_meshes.cactus_puppet import cactus_project
from sample_meshes.chair import make_chair
from sample_meshes.lamp import make_lamp
from sample_motions import make_library

from enliven.document import Project
from enliven.formats.project.file import write_project
from enliven.meshes import Mesh
from enliven.samples.shipped import COORDINATE_STEP_M, SAMPLES_FOLDER
from enliven_viewer.studio.workspace.files import MOTIONS_FILE


def write_samples(folder: Path) -> None:
    """Writes chair.npz, lamp.npz and cactus.enliven into a folder."""
    for mesh in (make_chair(), make_lamp()):
        steps = np.rint(mesh.vertices / COORDINATE_STEP_M).astype(np.int32)
        np.savez_compressed(
            folder / f"{mesh.name}.npz",
            vertices=compute_differences(steps),
            faces=compute_differences(mesh.faces),
            colours=mesh.colours,
        )
    project = cactus_project()
    puppet = project.puppet("cactus")
    write_project(
        folder / "cactus.enliven",
        project.with_characters(puppet.with_changes(mesh=quantize_mesh(puppet.mesh))),
    )


def write_motions(path: Path) -> None:
    """Writes the studio's library of motions."""
    write_project(path, Project().with_takes(*make_library()))


def compute_differences(rows: np.ndarray) -> np.ndarray:
    """Returns (3, N) int16 differences: each of the rows (N, 3) minus the previous row."""
    return np.ascontiguousarray(np.diff(rows, axis=0, prepend=0).astype(np.int16).T)


def quantize_mesh(mesh: Mesh) -> Mesh:
    """Returns the mesh with coordinates in whole steps.

    The order of its faces is chosen for good compression.
    """
    order = np.lexsort(mesh.faces.T[::-1])
    return replace(
        mesh, vertices=np.rint(mesh.vertices / COORDINATE_STEP_M) * COORDINATE_STEP_M, faces=mesh.faces[order]
    )


if __name__ == "__main__":
    write_samples(SAMPLES_FOLDER)
    write_motions(MOTIONS_FILE)
