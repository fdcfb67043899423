"""Tests that the steps in CONTRIBUTING.md are sufficient to add a class that the program then uses."""

import sys

import numpy as np
import pytest
from blocks import ROOT, blocks_of
from studio_driver import Click, HeadlessStage, JointPlace, Key, Wait, play

from enliven import cli
from enliven.document import Project, Skeleton, still_shape
from enliven.frames import DepthFrame
from enliven.recording import Recording
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.registry import ENTRY_POINTS
from enliven_viewer.studio.workspace.workspace import Workspace

CODE = [block.text for block in blocks_of(ROOT / "CONTRIBUTING.md") if block.kind == "python"]


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Returns a function that installs a module as pip does: as a package with one entry point."""
    installed = []

    def install_module(name, code, group, entry):
        about = tmp_path / "site" / f"{name}-1.0.dist-info"
        about.mkdir(parents=True)
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(f"[{group}]\n{entry}\n")
        (tmp_path / "site" / f"{name}.py").write_text(code)
        monkeypatch.syspath_prepend(tmp_path / "site")
        installed.append(name)

    yield install_module
    for name in installed:
        sys.modules.pop(name, None)


def code_with(word):
    """Returns the block of CONTRIBUTING.md that contains a word."""
    return next(code for code in CODE if word in code)


def test_a_reader_is_one_class(install, tmp_path, capsys):
    install("wall_reader", code_with("WallReader"), "enliven.readers", "wall = wall_reader:WallReader")
    (tmp_path / "a.wall").write_text("2000\n2100\n")
    assert cli.run(["import", "--list-readers"]) == 0 and "wall" in capsys.readouterr().out
    assert cli.run(["import", str(tmp_path / "a.wall"), "-o", str(tmp_path / "a.mcap")]) == 0
    frames = [frame for frame in Recording(tmp_path / "a.mcap").frames() if isinstance(frame, DepthFrame)]
    assert [int(frame.depth[0, 0]) for frame in frames] == [2000, 2100]
    (tmp_path / "b.wall").write_text("2000\nfar\n")
    assert cli.run(["import", str(tmp_path / "b.wall"), "-o", str(tmp_path / "b.mcap")]) == 3
    assert "line 2 is no whole number" in capsys.readouterr().err


def bone_project():
    """Returns a project with a shape of one bone above the floor."""
    bone = Skeleton(("a", "b"), np.array([-1, 0]), np.array([[0, 0.5, 0], [0, 1.5, 0.0]]))
    return Project().with_characters(still_shape("bone", bone))


def test_a_feature_is_one_package(install, tmp_path):
    install("half_speed", code_with("HalfSpeed"), ENTRY_POINTS, "half_speed = half_speed:register")
    workspace = Workspace.new(Editor(), tmp_path)
    workspace.input.key("ctrl+f9")
    assert workspace.editor.speed == 1.0 and "Nothing is there" in workspace.editor.toasts.shown[-1].text
    workspace.store.new(bone_project())
    workspace.input.key("ctrl+f9")
    assert workspace.editor.speed == 0.5 and workspace.actions.find("half")[0].id == "view.slow"
    assert workspace.state(sys.modules["half_speed"].HalfSpeed).editor is workspace.editor
    workspace.actions.set_shortcut("view.slow", "ctrl+f10")
    assert (
        Workspace.new(Editor(), tmp_path).actions.format_shortcut(workspace.actions["view.slow"])
        == "Ctrl+F10"
    )


AFTER_NOTHING = """
from enliven_viewer.studio.actions.action import Action

def register(app):
    app.actions.add(Action("a.b", "View", "B", (), app.editor.undo), after="view.none")
"""
TOOL_TWICE = """
from enliven_viewer.studio.tools.cut import CutTool

def register(app):
    app.add_tool(CutTool)
"""


@pytest.mark.parametrize(
    ("code", "problem"),
    [
        ("def register(app):\n    1 / 0", "division by zero"),
        ("import no_such_module", "No module named 'no_such_module'"),
        (AFTER_NOTHING, "action a.b: the action view.none is unknown"),
        (TOOL_TWICE, "action tool.cut: the shortcut c is already used by tool.cut"),
    ],
    ids=["in register", "at import", "after an unknown action", "a tool twice"],
)
def test_a_broken_feature_is_reported_and_the_studio_starts(install, tmp_path, code, problem):
    install("broken", code, ENTRY_POINTS, "broken = broken:register")
    workspace = Workspace.new(Editor(), tmp_path)
    (toast,) = workspace.editor.toasts.shown
    assert "the feature broken cannot be loaded" in toast.text and problem in toast.text
    assert toast.remedy == "Update or remove the package broken."
    assert workspace.actions.do("scan.open")


def test_a_tool_is_one_class_and_one_line(tmp_path):
    names: dict = {}
    exec(compile(code_with("FloorTool"), "CONTRIBUTING.md", "exec"), names)
    workspace = Workspace.new(Editor(), tmp_path)
    names["register"](workspace)
    workspace.store.new(bone_project())
    play([Key("1"), Wait(1.0), Key("f9"), Click(JointPlace("bone", 1))], HeadlessStage(workspace))
    assert abs(workspace.editor.stage_character("bone").handles[:, 1] - [0.0, 1.0]).max() < 1e-9
    assert workspace.editor.history.names == ("to the floor",)
    workspace.editor.history.undo()
    assert workspace.editor.stage_character("bone").handles[0, 1] == 0.5
