"""Tests of the view in which a user selects a chain of a take."""

from enliven import History, Project
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.mapping.source_view import SourceView, pose_take
from enliven_viewer.studio.workspace.files import read_library


def test_another_take_clears_the_hovered_joint():
    editor = Editor()
    editor.history = History(Project().with_takes(*read_library()))
    view = SourceView(editor)
    view.show("wave")
    last = len(view.clip.skeleton) - 1
    place = view.lens.project(pose_take(view.clip, 0.0).handles)[0][last]
    view.move((float(place[0]), float(place[1])))
    assert view.overlay().hovered[1] == last

    view.show("reach")
    assert len(view.clip.skeleton) <= last and view.overlay().hovered is None
