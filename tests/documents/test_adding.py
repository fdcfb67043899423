"""Tests that the steps in CONTRIBUTING.md are enough to add a class: the new classes are then used."""

import sys

import numpy as np
import pytest
from blocks import ROOT, blocks_of
from studio_driver import Click, HeadlessStage, JointPlace, Key, Wait, play

from enliven import cli
from enliven.document import Project, Skeleton, still_shape
from enliven.frames import DepthFrame
from enliven.recording import Recording
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.tools import TOOLS
from enliven_viewer.studio.workspace import Workspace

CODE = [block.text for block in blocks_of(ROOT / "CONTRIBUTING.md") if block.kind == "python"]


@pytest.fixture
def with_wall_reader(tmp_path, monkeypatch):
    """Installs the reader as a package of its own, as pip does: a module and its metadata."""
    about = tmp_path / "site" / "wall_reader-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: wall-reader\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[enliven.readers]\nwall = wall_reader:WallReader\n")
    (tmp_path / "site" / "wall_reader.py").write_text(next(code for code in CODE if "WallReader" in code))
    monkeypatch.syspath_prepend(tmp_path / "site")
    yield
    sys.modules.pop("wall_reader", None)


def test_a_reader_is_one_class(with_wall_reader, tmp_path, capsys):
    (tmp_path / "a.wall").write_text("2000\n2100\n")
    assert cli.run(["import", "--list-readers"]) == 0 and "wall" in capsys.readouterr().out
    assert cli.run(["import", str(tmp_path / "a.wall"), "-o", str(tmp_path / "a.mcap")]) == 0
    frames = [frame for frame in Recording(tmp_path / "a.mcap").frames() if isinstance(frame, DepthFrame)]
    assert [int(frame.depth[0, 0]) for frame in frames] == [2000, 2100]
    (tmp_path / "b.wall").write_text("2000\nfar\n")
    assert cli.run(["import", str(tmp_path / "b.wall"), "-o", str(tmp_path / "b.mcap")]) == 3
    assert "line 2 is no whole number" in capsys.readouterr().err


def test_an_action_is_one_line(tmp_path):
    names: dict = {}
    exec(compile(next(code for code in CODE if "add_slow" in code), "CONTRIBUTING.md", "exec"), names)
    workspace = Workspace.new(Editor(), tmp_path)
    names["add_slow"](workspace)
    workspace.input.key("ctrl+f9")
    assert workspace.editor.speed == 1.0 and "Nothing is there" in workspace.editor.toasts.shown[-1].text
    bone = Skeleton(("a", "b"), np.array([-1, 0]), np.array([[0, 0.5, 0], [0, 1.5, 0.0]]))
    workspace.store.new(Project().with_characters(still_shape("bone", bone)))
    workspace.input.key("ctrl+f9")
    assert workspace.editor.speed == 0.5 and workspace.actions.find("half")[0].id == "view.slow"


def test_a_tool_is_one_class_and_one_line(tmp_path, monkeypatch):
    names: dict = {}
    exec(compile(next(code for code in CODE if "FloorTool" in code), "CONTRIBUTING.md", "exec"), names)
    # The line in tools/registry.py: modules that read it are loaded already.
    before, after = TOOLS, (*TOOLS, names["FloorTool"])
    for module in [
        loaded for name, loaded in sys.modules.items() if name.startswith("enliven_viewer.studio.")
    ]:
        if vars(module).get("TOOLS") is before:
            monkeypatch.setattr(module, "TOOLS", after)
    workspace = Workspace.new(Editor(), tmp_path)
    bone = Skeleton(("a", "b"), np.array([-1, 0]), np.array([[0, 0.5, 0], [0, 1.5, 0.0]]))
    workspace.store.new(Project().with_characters(still_shape("bone", bone)))
    play([Key("1"), Wait(1.0), Key("f9"), Click(JointPlace("bone", 1))], HeadlessStage(workspace))
    assert abs(workspace.editor.stage_character("bone").handles[:, 1] - [0.0, 1.0]).max() < 1e-9
    assert workspace.editor.history.names == ("to the floor",)
    workspace.editor.history.undo()
    assert workspace.editor.stage_character("bone").handles[0, 1] == 0.5
