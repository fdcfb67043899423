"""Tests that the code of docs/examples.md runs unchanged and prints the page's output, and that its session
is valid."""

import re
import tomllib
from pathlib import Path

import numpy as np
from puppet_worlds import stool, walker

from enliven.document.project import Project
from enliven.example_sessions.session import read_session
from enliven.examples.puppet_motion import solve_layer_motion
from enliven.formats.project.file import write_project
from enliven.meshes.files import save_mesh

PAGE = Path(__file__).parents[3] / "docs" / "examples.md"


def blocks(kind):
    return re.findall(rf"```{kind}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def test_code_of_the_page_runs(capsys):
    names = {}
    assert len(blocks("python")) == 4
    for block in blocks("python"):
        exec(compile(block, str(PAGE), "exec"), names)
    output = capsys.readouterr().out
    assert "('Pose two examples.',)" in output
    assert "(31, 4, 3) True ()" in output
    assert output.count("True") == 3
    assert output.rstrip().endswith("(31, 2, 3)")
    cactus, state = names["cactus"], names["state"]
    # It moves between its two examples, and the pot stays.
    low, high = names["down"][1, 1], names["up"][1, 1]
    assert low + 0.2 < state.places[1, 1] < high - 0.2
    np.testing.assert_allclose(state.places[3], cactus.rest[3], atol=0.02)


def test_its_session_can_be_played(tmp_path):
    [text] = blocks("toml")
    tomllib.loads(text)
    save_mesh(stool(), tmp_path / "stool.ply")
    write_project(tmp_path / "walk.enliven", Project().with_takes(walker()))
    text = text.replace("cactus.off", "stool.ply").replace("traffic.bvh", "walk.enliven")
    (tmp_path / "page.toml").write_text(text)
    read = read_session(tmp_path / "page.toml")
    puppet = read.project.puppets["stool"]
    assert [point.name for point in puppet.points] == ["left arm", "top"] and puppet.layers[0].loop
    np.testing.assert_allclose(puppet.poses[0].places[0], puppet.rest[0] - [0, 0.2, 0])
    assert solve_layer_motion(read.project, puppet, 0).places.shape == (91, 2, 3)


def test_modules_named_in_the_page_exist():
    table = PAGE.read_text(encoding="utf-8").split("| module of `enliven.examples` | |")[1].split("## ")[0]
    for name in re.findall(r"^\| (.*?) \|", table, re.MULTILINE)[1:]:
        for module in re.findall(r"`([\w.]+)`", name):
            if module[0].islower():
                assert (
                    PAGE.parents[1] / "shared" / "enliven" / "examples" / f"{module.replace('.', '/')}.py"
                ).exists(), module
