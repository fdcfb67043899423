"""Tests that unrigged meshes, takes and sessions open, and that puppets are exported as GLB with their
error.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pygltflib
import pytest

sys.path.append(str(Path(__file__).parents[1]))
from made_studio_puppets import project_with, star, studio

from enliven.document.project import Project, are_identical
from enliven.errors import InputError
from enliven.examples.puppet_motion import evaluate_state
from enliven.formats.motion.expmap import COLUMNS
from enliven.meshes.files import save_mesh
from enliven.meshes.mesh import Mesh
from enliven.modeling.puppet.poses import add_key_pose
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.puppets.puppet_editor import PuppetEditor, get_puppet_editor
from enliven_viewer.studio.workspace.exporting import export
from enliven_viewer.studio.workspace.workspace import Workspace

NAMES = ("head", "left", "right", "foot")


def find_puppets(workspace: Workspace) -> PuppetEditor:
    """Returns the puppet editor of a workspace."""
    return get_puppet_editor(workspace.editor)


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    return Workspace.new(Editor(), tmp_path / "recovery")


def acting() -> Project:
    project = project_with(*NAMES, take="sway")
    rest = project.puppets["star"].rest
    for k, time in enumerate((0.0, 0.75, 2.25)):
        moved = rest + 0.06 * k * np.array([[1.0, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 0]])
        project = add_key_pose(project, "star", "sway", time, moved)
    return project


def said(workspace: Workspace) -> str:
    return " | ".join(f"{toast.text} {toast.remedy}" for toast in workspace.editor.toasts.shown)


@pytest.mark.parametrize("ending", [".obj", ".ply", ".stl", ".off", ".glb"])
def test_a_mesh_without_a_rig_opens_as_a_puppet_that_stands(
    workspace: Workspace, tmp_path, ending: str
) -> None:
    raised = Mesh(np.add(star().vertices, [0.3, 2.0, 0.1]), star().faces, "star")
    save_mesh(raised, tmp_path / f"star{ending}")
    workspace.open(tmp_path / f"star{ending}")
    puppet = find_puppets(workspace).puppet
    assert puppet is not None and puppet.id == "star" and not workspace.editor.project.shapes
    assert puppet.mesh.vertices[:, 1].min() == pytest.approx(0.0, abs=1e-6)
    assert np.ptp(puppet.mesh.vertices[:, 1]) == pytest.approx(np.ptp(star().vertices[:, 1]), rel=1e-4)
    workspace.open(tmp_path / f"star{ending}")
    other = workspace.editor.project.puppets["star 2"]
    assert other.place[0] > puppet.mesh.vertices[:, 0].max(), "beside the first"


def test_a_mesh_in_millimetres_gets_its_size_in_metres_with_a_note(workspace: Workspace, tmp_path) -> None:
    save_mesh(Mesh(1000.0 * star().vertices, star().faces, "star"), tmp_path / "star.ply")
    workspace.open(tmp_path / "star.ply")
    tall = np.ptp(star().vertices[:, 1])
    assert np.ptp(find_puppets(workspace).puppet.mesh.vertices[:, 1]) == pytest.approx(tall)
    assert "read in millimetres" in said(workspace)


def test_unreadable_mesh_changes_nothing(workspace: Workspace, tmp_path) -> None:
    (tmp_path / "bad.ply").write_bytes(b"ply\nnothing more")
    before = workspace.editor.project
    with pytest.raises(InputError):
        workspace.open(tmp_path / "bad.ply")
    assert workspace.editor.project is before


def test_a_table_of_exponential_maps_opens_as_a_take(workspace: Workspace, tmp_path) -> None:
    rows = np.zeros((20, COLUMNS))
    rows[:, 1] = np.linspace(17.0, 18.0, 20)
    np.savetxt(tmp_path / "hop.txt", rows, delimiter=",")
    workspace.open(tmp_path / "hop.txt")
    clip = workspace.editor.project.takes["hop"]
    assert len(clip.turns) == 20 and "LeftHand" in clip.skeleton.names


def test_session_is_saved_and_opens_next_to_the_others(tmp_path) -> None:
    workspace, _ = studio(tmp_path / "recovery", *NAMES)
    workspace.store.new(acting())
    workspace.editor.select_only("star")
    workspace.open_dialogue("session")
    assert (
        workspace.asking == "session"
        and workspace.browser is not None
        and workspace.browser.name == "star.toml"
    )
    workspace.finish_file_dialog(tmp_path / "star.toml")
    assert (tmp_path / "star.toml").is_file()
    workspace.open(tmp_path / "star.toml")
    project = workspace.editor.project
    assert (
        list(project.puppets) == ["star", "star 2"]
        and find_puppets(workspace).puppet is project.puppets["star 2"]
    )
    first, second = (evaluate_state(project, project.puppets[name], 1.1) for name in ("star", "star 2"))
    np.testing.assert_allclose(second.places, first.places, atol=1e-6)
    assert [name for name in project.takes if name.startswith("sway")] == ["sway"], "the take is the same one"


def test_a_session_needs_a_puppet(workspace: Workspace) -> None:
    workspace.actions.do("file.session")
    assert workspace.asking == "" and "No puppet is chosen" in said(workspace)


@pytest.mark.slow
def test_puppets_are_exported_as_glb_with_their_error(tmp_path) -> None:
    workspace, _ = studio(tmp_path / "recovery", *NAMES)
    workspace.store.new(acting())
    before = workspace.editor.project
    workspace.open_dialogue("export")
    workspace.finish_file_dialog(tmp_path / "star.glb")
    assert workspace.editor.background.busy
    workspace.editor.background.finish()
    assert not workspace.editor.background.busy and are_identical(workspace.editor.project, before)
    assert "Wrote 1 shape to star.glb" in said(workspace) and "mm" in said(workspace)
    written = pygltflib.GLTF2().load(tmp_path / "star.glb")
    samplers = written.animations[0].samplers
    assert max(written.accessors[sampler.input].max[0] for sampler in samplers) == pytest.approx(
        3.0, abs=0.05
    )
    assert len(written.skins) == 1 and len(samplers) > 10


def test_failed_export_is_reported_and_exports_are_queued(tmp_path) -> None:
    workspace, _ = studio(tmp_path / "recovery", *NAMES)
    workspace.store.new(acting())
    (tmp_path / "file").write_text("in the way")
    workspace.open_dialogue("export")
    workspace.finish_file_dialog(tmp_path / "file" / "star.glb")
    workspace.editor.background.begin("second", lambda: "never", workspace.editor.toasts.show_message)
    assert "still running" in said(workspace)
    workspace.editor.background.finish()
    assert any(toast.is_error for toast in workspace.editor.toasts.shown) and "never" not in said(workspace)


def test_puppet_without_motion_reports_its_missing_parts(tmp_path) -> None:
    with pytest.raises(InputError, match="Pose two examples"):
        export(project_with(*NAMES, take="sway"), tmp_path / "no.glb")
    assert not (tmp_path / "no.glb").exists()
