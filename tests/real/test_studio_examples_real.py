"""Tests of animating third-party meshes by third-party motions with the parts of the studio's example
panel.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from enliven.examples.puppet_examples import find_missing_examples
from enliven.examples.puppet_motion import evaluate_state
from enliven.modeling.puppet.poses import change_key_pose
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.puppets.key_pose_navigator import KeyPoseNavigator
from enliven_viewer.studio.features.puppets.performer_view import PerformerView
from enliven_viewer.studio.puppets.coverage import CoverageCache
from enliven_viewer.studio.puppets.example_edits import turn_quarter, with_guessed_joints, with_points
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.workspace.workspace import Workspace

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
CACTUS = DATA / "meshes" / "cinolib" / "cactus.off"
TRAFFIC = DATA / "cmu_expmap" / "train_directing_traffic_4.txt"
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(
        not (CACTUS.is_file() and TRAFFIC.is_file()),
        reason=f"no cactus or CMU motion in {DATA} (set ENLIVEN_DATA)",
    ),
]
ENDS = ((0.0, 1.0, 0.0), (-0.27, 0.95, 0.0), (0.27, 0.95, 0.0), (0.0, 0.0, 0.05))
"""Positions of head, two hands and foot relative to the mesh's height, facing +Z."""


def test_a_cactus_that_lies_on_its_back_is_stood_up_and_directs_traffic(tmp_path):
    workspace = Workspace.new(Editor(), tmp_path / "recovery")
    workspace.open(CACTUS)
    workspace.open(TRAFFIC)
    editor, name, take = workspace.editor, "cactus", TRAFFIC.stem
    for axis in ("x", "y"):
        assert editor.edit("stand", lambda project, axis=axis: turn_quarter(project, name, axis))
    mesh = editor.project.puppets[name].mesh
    wide, tall, deep = np.ptp(mesh.vertices, axis=0)
    assert tall > wide > deep, "it stands, and its arms are at its sides"
    ends = [int(np.linalg.norm(mesh.vertices - tall * np.array(at), axis=1).argmin()) for at in ENDS]
    workspace.state(PerformerView).show(take)
    assert editor.edit("points", lambda project: with_points(project, name, ends))
    assert editor.edit("guess", lambda project: with_guessed_joints(project, name, take))
    points = editor.project.puppets[name].points
    assert [point.name for point in points[:3]] in (
        ["head", "right hand", "left hand"],
        ["head", "left hand", "right hand"],
    )
    assert not points[3].foot, "what follows the hips does not step"
    coverage = workspace.state(CoverageCache).find_coverage(
        editor.project, editor.project.puppets[name], take
    )
    assert coverage is not None and 2 <= coverage.needed <= 12
    for number, second in enumerate(coverage.times[:3]):
        workspace.state(KeyPoseNavigator).begin(take, second)
        places = np.array(editor.project.puppets[name].rest)
        places[1:3] += 0.1 * tall * np.array([[0, number - 1, 0], [0, 1 - number, 0]])
        change = {"places": places}
        assert editor.edit("pose", lambda project, n=number, c=change: change_key_pose(project, name, n, **c))
    get_puppet_editor(workspace.editor).accept()
    project, puppet = get_puppet_editor(editor).motion_solver.settle(editor.project, name)
    assert (
        not find_missing_examples(project, puppet)
        and get_puppet_editor(editor).motion_solver.problem(name) is None
    )
    assert puppet is editor.project.puppets[name]
    for pose, second in zip(puppet.poses, coverage.times[:3], strict=True):
        shown_places = evaluate_state(project, puppet, second).places
        assert np.abs(shown_places - pose.places).max() < 0.05 * tall, "close to its examples, and smooth"
    after = workspace.state(CoverageCache).find_coverage(project, puppet, take)
    assert after is not None and after.remaining_distance < coverage.remaining_distance
