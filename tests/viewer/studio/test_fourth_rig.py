"""Tests that a rig defined only in the tests can be put on a stage, performed, edited and exported."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cage_actor
import numpy as np
import pytest
from cage import Cage, CageRig, cage_of
from sample_meshes.chair import make_chair
from staged_session import StagedSession, person, staged_sessions

from enliven.document import GraphCharacter, Project
from enliven.formats.gltf.read import read_gltf
from enliven.modeling.edits import compute_vertices, move_character
from enliven.oneshot.exporting import export
from enliven_edge import uploaded_actor

RAISED_M = 0.4
"""Height by which the performer raises both hands, metres."""


@pytest.fixture
def sitting(tmp_path: Path) -> Iterator:
    with staged_sessions(tmp_path) as make:
        yield make


def perform(session: StagedSession) -> Project:
    """Puts a cage on the stage and records a performer that raises both hands. Returns the project."""
    editor = session.editor
    editor.edit("open", lambda project: project.with_characters(cage_of(make_chair(0.05), "chair")))
    editor.select_only("chair")
    session.connect()
    session.present = [person()]
    session.until(lambda: session.perform.performers)
    session.perform.possession_requests.press()
    session.until(lambda: session.held == {"chair"}, "the cage is held")
    session.perform.recording.count_in = False
    session.perform.recording.toggle()
    session.until(lambda: session.perform.recording.phase == "recording", "the recording")
    for step in range(31):
        body = person()
        joints = body.joints.copy()
        for joint in cage_actor.JOINTS[:2]:
            joints[joint, 1] += RAISED_M * step / 30
        session.present = [replace(body, joints=joints)]
        session.run_frames(2)
    session.perform.recording.stop()
    session.until(lambda: editor.project.takes, "the recording is kept")
    return editor.project


def test_a_rig_with_an_actor_is_performed_recorded_edited_and_exported(sitting, tmp_path: Path) -> None:
    session = sitting()
    project = perform(session)
    cage = project.character("chair", Cage)
    (layer,) = cage.layers
    begin, end = layer.offset, layer.offset + project.length_of(layer)
    before, after = (compute_vertices(project, "chair", time) for time in (begin, end))
    assert np.ptp((after - before)[:, 1]) > 0.05, "the corners follow the hands"
    raised = CageRig().corners_at(project, cage, end) - CageRig().corners_at(project, cage, begin)
    assert np.allclose(raised[2:], 0.0, atol=0.01), "the feet stood still"
    assert np.allclose(raised[:2], [0.0, RAISED_M, 0.0], atol=0.05)
    moved = move_character(project, "chair", np.array([1.0, 0.0, 0.0]))
    assert np.allclose(compute_vertices(moved, "chair", end), after + np.array([1.0, 0.0, 0.0]), atol=1e-6)
    path = tmp_path / "chair.glb"
    export(moved, path)
    scene = read_gltf(path)
    assert scene.clips and scene.clips[0].duration == pytest.approx(end, abs=0.1)


@pytest.mark.slow
def test_without_an_actor_performers_hold_its_surface(sitting, monkeypatch) -> None:
    monkeypatch.delitem(uploaded_actor.ACTORS, Cage.kind)
    monkeypatch.delitem(cage_actor.RECORDERS, Cage.kind)
    session = sitting()
    project = perform(session)
    assert isinstance(project.character("chair"), Cage), "the character stays"
    (performed,) = project.graphs.values()
    assert isinstance(performed, GraphCharacter)
    assert len(performed.mesh.vertices) == len(project.character("chair").mesh.vertices)
    assert project.length_of(performed.parts[0]) > 0.5
