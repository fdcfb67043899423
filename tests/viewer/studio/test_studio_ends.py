"""Tests of naming the five ends of a possessed mesh: marks are shown, can be dragged, and are stored."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from known_bodies import t_pose

from enliven.document.project import are_identical
from enliven.formats.project.file import read_project, write_project
from enliven.formats.project.one_character import character_bytes, project_of_mesh
from enliven.modeling.edits import mirror_character, scale_character
from enliven.person import Joint
from enliven.wire import PutCharacter
from enliven_edge.settings import EdgeSettings
from enliven_edge.uploaded_actor import create_uploaded_actor
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.tools.base import Pointer
from enliven_viewer.studio.tools.limb_ends import END_NAMES, LimbEndsTool
from enliven_viewer.studio.workspace.workspace import Workspace

KNOWN = t_pose()
ENDS = (Joint.HEAD, Joint.HAND_LEFT, Joint.HAND_RIGHT, Joint.FOOT_LEFT, Joint.FOOT_RIGHT)
ROUNDED = 1e-6
"""Tolerance in metres: a project's mesh is rounded to float32."""
FINGERS = 0.2
"""Maximum distance in metres between the joint of a hand, foot or head and its end."""


@pytest.fixture
def workspace() -> Workspace:
    project = project_of_mesh(KNOWN.mesh, "man")
    settings = StudioSettings(render=RenderSettings(shadow_size=64, contact_size=32, samples=1))
    opened = Workspace(Editor(project=project, settings=settings))
    opened.editor.select_only("man")
    opened.editor.frame_all(at_once=True)
    return opened


@pytest.fixture
def tool(workspace) -> LimbEndsTool:
    workspace.input.activate_tool("ends")
    ends_tool = workspace.input.tool
    assert isinstance(ends_tool, LimbEndsTool)
    assert not len(ends_tool.marks)
    ends_tool.wait()
    return ends_tool


def drag(tool: LimbEndsTool, start, end) -> None:
    """Drags the pointer from one pixel to another."""
    tool.press(Pointer(tuple(start)))
    tool.drag(Pointer(tuple(np.add(start, end) / 2)))
    tool.drag(Pointer(tuple(end)))
    tool.release(Pointer(tuple(end)))


def pixels(tool: LimbEndsTool, places) -> np.ndarray:
    """Returns the (N, 2) pixels of positions."""
    return tool.editor.lens.project(np.asarray(places))[0]


def test_the_ends_are_shown_where_they_are_found_before_any_is_named(tool):
    places = KNOWN.mesh.vertices[tool.marks]
    assert (np.linalg.norm(places - KNOWN.joints[list(ENDS)], axis=1) < FINGERS).all()
    words = [mark.text for mark in tool.overlay().marks if hasattr(mark, "text")]
    assert words == list(END_NAMES) and "Drag" in tool.hint
    assert not len(tool.editor.project.character("man").ends), "they are a suggestion"


def test_a_mark_is_dragged_over_the_surface_and_undone(tool):
    editor, before = tool.editor, tool.editor.project
    marks = pixels(tool, KNOWN.mesh.vertices[tool.marks])
    elbow = pixels(tool, KNOWN.joints[[Joint.ELBOW_LEFT]])[0]
    drag(tool, marks[1], elbow)
    ends = editor.project.character("man").ends
    assert ends.shape == (5, 3) and np.linalg.norm(ends[1] - KNOWN.joints[Joint.ELBOW_LEFT]) < 0.12
    assert (np.linalg.norm(KNOWN.mesh.vertices[:, None] - ends, axis=2).min(0) < ROUNDED).all()
    np.testing.assert_allclose(pixels(tool, ends)[[0, 2, 3, 4]], marks[[0, 2, 3, 4]], atol=0.01)
    assert editor.history.undo_name == "name the left hand"
    tool.type("delete")
    assert not len(editor.project.character("man").ends)
    editor.undo()
    editor.undo()
    assert are_identical(editor.project, before)


def test_clicks_off_the_mesh_and_escape_name_nothing(tool):
    before = tool.editor.project
    marks = pixels(tool, KNOWN.mesh.vertices[tool.marks])
    tool.press(Pointer(tuple(marks[0])))
    tool.drag(Pointer(tuple(pixels(tool, KNOWN.joints[[Joint.SPINE]])[0])))
    tool.cancel()
    tool.release(Pointer((5.0, 5.0)))
    assert tool.editor.project is before
    assert not tool.press(Pointer((5.0, 5.0))), "the drag is the camera's"


def test_a_mesh_that_is_no_person_has_five_marks_too(tool):
    tool.editor.open_project(
        project_of_mesh(KNOWN.mesh.with_faces(np.arange(len(KNOWN.mesh.faces)) < 60), "rag")
    )
    tool.editor.select_only("rag")
    assert not len(tool.marks)
    tool.wait()
    assert tool.marks.shape == (5,)


def named(seed):
    """Returns a project with ends at random vertices, and the ends."""
    ends = KNOWN.mesh.vertices[np.random.default_rng(seed).choice(len(KNOWN.mesh.vertices), 5, replace=False)]
    project = project_of_mesh(KNOWN.mesh, "man")
    return project.with_characters(project.character("man").with_changes(ends=ends))


@given(st.integers(0, 10**6), st.floats(0.2, 5.0))
def test_ends_stay_on_the_mesh_through_edits(seed, factor):
    project = named(seed)
    character = project.character("man")
    at = [int(np.linalg.norm(character.mesh.vertices - end, axis=1).argmin()) for end in character.ends]
    larger = scale_character(project, "man", factor).character("man")
    np.testing.assert_allclose(larger.ends, larger.mesh.vertices[at], atol=ROUNDED * factor)
    other = mirror_character(project, "man", (1.0, 0.0, 0.0)).character("man")
    swapped = np.array(at)[[0, 2, 1, 4, 3]]
    np.testing.assert_allclose(other.ends, other.mesh.vertices[swapped], atol=ROUNDED)


@pytest.mark.slow
def test_ends_are_kept_in_a_file_and_taken_by_an_edge(tmp_path):
    project = named(3)
    write_project(tmp_path / "named.enliven", project)
    assert are_identical(read_project(tmp_path / "named.enliven"), project)
    ends = KNOWN.mesh.vertices[
        [int(np.linalg.norm(KNOWN.mesh.vertices - KNOWN.joints[k], axis=1).argmin()) for k in ENDS]
    ]
    ends = ends[[0, 2, 1, 4, 3]]  # rotated by half a turn, the left end must become the right one
    character = project.character("man").with_changes(ends=ends)
    data = character_bytes(project.with_characters(character), "man")
    for fit in (False, True):
        order = PutCharacter("man", 1, b"\0" * 32, len(data), fit)
        actor = create_uploaded_actor(data, order, EdgeSettings())
        assert actor.likeness is not None and actor.likeness.human
        placed = actor.likeness.joints
        front = np.sign(placed[Joint.HAND_LEFT, 0] - placed[Joint.HAND_RIGHT, 0])
        assert front * np.cos(actor.likeness.yaw) > 0, "left is where it was named"
