"""Tests that public validators find no error in the files of any real motion on any real model."""

from __future__ import annotations

import os
from pathlib import Path

import khronos_validator
import pytest

from enliven.oneshot.retargeting import RetargetOptions, retarget_file

usd_reader = pytest.importorskip("usd_reader", reason="the library of USD is not installed")

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
MODELS = sorted(path for path in (DATA / "gltf").rglob("*") if path.suffix in (".glb", ".gltf"))
MOTIONS = [
    DATA / "bvh" / name
    for name in (
        "cmu_mirrors/CMU_Sample_05_01.bvh",
        "xia_styles/neutral_01_000.bvh",
        "bandai_namco/dataset-1_punch_normal_001.bvh",
        "bandai_namco/dataset-1_bow_normal_001.bvh",
        "other/aitviewer_sample.bvh",
    )
]
OPTIONS = RetargetOptions(end=1.5)
"""The first 1.5 seconds contain every kind of data that a whole file contains."""
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not MODELS, reason="the real models (ENLIVEN_DATA) are not here"),
    pytest.mark.skipif(
        bool(khronos_validator.MISSING_REASON), reason=khronos_validator.MISSING_REASON or "all is here"
    ),
]


@pytest.mark.timeout(600)
@pytest.mark.parametrize("model", MODELS, ids=lambda path: path.stem)
def test_validators_find_no_error(model: Path, tmp_path: Path) -> None:
    glbs = []
    for number, motion in enumerate(MOTIONS):
        glbs.append(tmp_path / f"{number}.glb")
        retarget_file(motion, model, glbs[-1], OPTIONS)
        usd = tmp_path / f"{number}.usdc"
        retarget_file(motion, model, usd, OPTIONS)
        assert usd_reader.validation_errors(usd) == [], motion.name
    assert khronos_validator.find_errors(glbs) == []


def test_khronos_validator_reports_a_damaged_file(tmp_path: Path) -> None:
    path = tmp_path / "damaged.glb"
    retarget_file(MOTIONS[0], DATA / "gltf" / "khronos" / "RiggedSimple.glb", path, OPTIONS)
    path.write_bytes(path.read_bytes().replace(b'"POSITION"', b'"POSITIOM"'))
    assert any("POSITIOM" in error for error in khronos_validator.find_errors([path]))
