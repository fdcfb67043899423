"""Small motions and characters for the tests of batches."""

from pathlib import Path

import numpy as np
import pytest
from made_bodies import bvh_text, horse, man, shape_with_markers

from enliven.document.project import Project
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import write_gltf


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """Returns a folder with two motions of a man in ``motions`` and two models in ``characters``."""
    motions, characters = tmp_path / "motions", tmp_path / "characters"
    motions.mkdir()
    characters.mkdir()
    for number, name in enumerate(("walk", "run")):
        phases = np.arange(12)[:, None, None] + np.arange(len(man()))[None, :, None]
        swing = (8.0 + 4.0 * number) * np.sin(phases)
        (motions / f"{name}.bvh").write_text(bvh_text(man(), np.tile(swing, (1, 1, 3))))
    (motions / "notes.txt").write_text("Recorded on a Tuesday.\n")
    for name, skeleton in (("horse", horse()), ("man", man())):
        project = Project().with_characters(shape_with_markers(name, skeleton))
        write_gltf(characters / f"{name}.glb", [sample_performance(project, name)], name)
    return tmp_path
