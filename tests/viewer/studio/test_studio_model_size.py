"""Tests that models open at a size that people can possess, with a note, and are framed by the camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from enliven.document.project import Project
from enliven.document.rigged import still_shape
from enliven.document.skeleton import Skeleton
from enliven.modeling.edits import scale_character
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.path_framing import frame_path
from enliven_viewer.studio.viewport.overlay import Overlay
from enliven_viewer.studio.viewport.selection import Selection
from enliven_viewer.studio.viewport.skeletons import make_skeleton_rows
from enliven_viewer.studio.workspace.exporting import export
from enliven_viewer.studio.workspace.model_size import choose_size
from enliven_viewer.studio.workspace.workspace import Workspace

FARTHEST_M = 9.0
"""Maximum distance in metres between the camera and the centre of the largest model that opens unchanged."""


def box_of(wide: float, tall: float, deep: float) -> list[list[float]]:
    return [[0.0, 0.0, 0.0], [wide, tall, deep]]


@pytest.mark.parametrize(
    ("box", "height", "words"),
    [
        ((25.2, 79.0, 154.7), 0.79, "read in centimetres"),
        ((500.0, 1800.0, 300.0), 1.8, "read in millimetres"),
        ((0.0005, 0.0017, 0.0004), 1.7, "read in kilometres"),
        ((8.0, 15.2, 31.0), 1.7, "scaled to 1.7 m"),
        ((8.4, 1.34, 11.7), 0.4, "scaled to 0.4 m"),
        ((0.1, 0.154, 0.1), 1.7, "scaled to 1.7 m"),
        ((0.5, 1.7, 0.3), 1.7, ""),
        ((3.5, 0.2, 0.3), 0.2, ""),
        ((2.0, 0.0, 2.0), 0.0, ""),
    ],
)
def test_implausible_size_is_changed_with_a_note(box, height: float, words: str) -> None:
    size = choose_size(box_of(*box))
    assert (
        size.height == pytest.approx(height, rel=0.02)
        and words in size.note
        and bool(words) == bool(size.note)
    )


@pytest.mark.parametrize("larger", [0.01, 0.2, 1.0, 12.0, 90.0, 1000.0])
def test_a_rigged_model_of_any_size_opens_near_the_camera(make_limb, tmp_path: Path, larger: float) -> None:
    path = tmp_path / "limb.glb"
    project = scale_character(Project().with_characters(make_limb()), "limb", larger)
    export(project, path)
    workspace = Workspace.new(Editor(), tmp_path)
    assert workspace.run_and_report(lambda: workspace.open(path))
    editor = workspace.editor
    tall = float(np.ptp(editor.visible_characters[0].vertices[:, 1]))
    assert 0.25 <= tall <= 3.0
    noted = [toast.text for toast in editor.toasts.shown if "m tall" in toast.text]
    assert bool(noted) == (larger not in (1.0,))
    editor.frame_all()
    assert editor.camera.goal[5] < FARTHEST_M
    editor.camera.advance(100.0)
    pixels = editor.lens.project(editor.visible_characters[0].vertices)[0]
    assert (pixels >= 0).all() and (pixels <= editor.size).all()
    assert np.ptp(pixels[:, 1]) > 0.3 * editor.size[1], "it fills the picture"


def test_a_joint_far_off_the_surface_moves_no_camera(make_limb, tmp_path: Path) -> None:
    limb = make_limb()
    bones = limb.skeleton
    target = Skeleton(
        (*bones.names, "target"), np.append(bones.parents, 0), np.vstack([bones.positions, [0.0, 0.5, 13.0]])
    )
    mesh = limb.mesh
    stray = still_shape("stray", target, mesh, limb.skin)
    editor = Editor(project=Project().with_characters(stray))
    editor.frame_all()
    all_of_it = editor.camera.goal[5]
    frame_path(editor)
    assert all_of_it < 5.0 and editor.camera.goal[5] < 5.0


def test_bones_are_no_thicker_than_a_share_of_the_skeleton(make_limb) -> None:
    editor = Editor(project=Project().with_characters(make_limb()))
    editor.frame_all(at_once=True)
    thick = {}
    for away in (1.0, 40.0):
        editor.camera.go(editor.camera.target, 0.5, 0.2, 5.0 * away)
        editor.camera.advance(100.0)
        thick[away] = make_skeleton_rows(editor.visible_characters[0], editor.lens, Selection(), Overlay())[
            :, 3
        ].max()
    size = float(np.ptp(editor.visible_characters[0].handles, axis=0).max())
    assert thick[40.0] <= 0.03 * size, "from afar the bones would hide the model"
    assert thick[1.0] > 0.004
