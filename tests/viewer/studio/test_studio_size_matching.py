"""Tests that an object whose size differs from the others is reported on opening, and fitted by one
action.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_acting_stage import acting_stage

from enliven.meshes.files import save_mesh
from enliven.modeling.edits import compute_vertices, scale_character
from enliven.samples.shipped import load_sample
from enliven_viewer.studio.workspace.workspace import Workspace


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    return acting_stage(tmp_path_factory.mktemp("fitting"))


def box(stage: Workspace, name: str) -> tuple[np.ndarray, np.ndarray]:
    vertices = compute_vertices(stage.editor.project, name, stage.editor.time)
    return vertices.min(0), vertices.max(0)


@given(st.sampled_from(["limb", "post", "star"]), st.floats(0.2, 6.0))
@settings(max_examples=12)
@pytest.mark.slow
def test_fitting_matches_the_others_height_in_place(stage, name, size) -> None:
    editor = stage.editor
    editor.go_to(0)
    editor.scrub(0.0)
    editor.edit("scale", lambda project: scale_character(project, name, size))
    editor.select_only(name)
    low, high = box(stage, name)
    others = [
        np.ptp([side[1] for side in box(stage, other_name)])
        for other_name in editor.project.characters
        if other_name != name
    ]
    assert stage.actions.do("shape.fit") == (abs((high - low)[1] / np.median(others) - 1.0) >= 0.01)
    now_low, now_high = box(stage, name)
    assert (now_high - now_low)[1] == pytest.approx(np.median(others), rel=0.02)
    assert now_low[1] == pytest.approx(low[1], abs=5e-3)
    np.testing.assert_allclose(((now_low + now_high) / 2)[[0, 2]], ((low + high) / 2)[[0, 2]], atol=5e-3)


def test_only_a_differing_size_is_reported_on_opening(stage: Workspace, tmp_path: Path) -> None:
    editor = stage.editor
    editor.go_to(0)
    chair = load_sample("chair")
    for name, size in (("giant", 2.9), ("alike", 0.8)):
        tall = float(np.ptp(chair.vertices[:, 1]))
        save_mesh(replace(chair, vertices=chair.vertices * size / tall), tmp_path / f"{name}.ply")
        stage.open(tmp_path / f"{name}.ply")
        texts = [
            toast.text for toast in editor.toasts.shown if f"The new shape is {size:g} m tall" in toast.text
        ]
        assert bool(texts) == (name == "giant")
        editor.undo()
    editor.select_only(None)
    assert not stage.actions.do("shape.fit")
