"""Tests of session files: written by hand or by a program, read back equal, and refused with table and
key.
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_lanes import lanes
from puppet_worlds import full_project, places_for, puppet_project, stool, walker

from enliven.document import MotionKey, RootLayer, clip_from_keys
from enliven.document.constraints import Position
from enliven.document.locomotion import Switch
from enliven.document.project import Project, are_identical
from enliven.document.puppet import PuppetLayer
from enliven.document.time_map import TimeMap
from enliven.errors import InputError
from enliven.example_sessions.session import read_session
from enliven.example_sessions.tables import (
    INNER_TABLES,
    ROOT_INNER_TABLES,
    LayerTable,
    MeshTable,
    RootTable,
    TakeTable,
)
from enliven.example_sessions.text import session_text, write_session
from enliven.examples.puppet_motion import solve_layer_motion
from enliven.formats.project.file import write_project
from enliven.meshes.files import load_mesh, save_mesh
from enliven.meshes.mesh import fit_height
from enliven.modeling.edits import compute_vertices, key_characters
from enliven.modeling.puppet.poses import add_key_pose
from enliven.rotation import normalized

BY_HAND = """
[mesh]
file = "stool.ply"
height = 0.5

[[take]]
file = "moves.enliven"

[[point]]
name = "left foot"
at = [0.15, 0.0, 0.1]
joint = "LeftFoot"
foot = true

[[point]]
name = "right foot"
at = [-0.15, 0.0, 0.1]
joint = "RightFoot"
foot = true

[[point]]
vertex = 300
joint = "Head"
weight = 2.5

[[pose]]
time = 0.2
moves = { "left foot" = [0.0, 0.1, 0.2] }

[[pose]]
take = "walk"
frame = 30
[pose.places]
"right foot" = [-0.2, 0.05, 0.1]

[symmetry]
normal = [1, 0, 0]

[settings.examples]
acceleration = 0.1

[[layer]]
loop = true
speed = 2
[[layer.position]]
point = "point 3"
frame = 3
place = [0, 0.5, 0]
axes = "y"
[[layer.switch]]
frame = 0
kind = "contact"
"""


@pytest.fixture
def folder(tmp_path):
    save_mesh(stool(), tmp_path / "stool.ply")
    write_project(tmp_path / "moves.enliven", Project().with_takes(walker(), walker(1, "short")))
    (tmp_path / "session.toml").write_text(BY_HAND)
    return tmp_path


def test_hand_written_session_is_read(folder):
    read = read_session(folder / "session.toml")
    puppet = read.project.puppets["stool"]
    assert read.puppet == "stool"
    np.testing.assert_allclose(puppet.mesh.bounds, [[-0.15, 0, -0.1], [0.15, 0.5, 0.1]], atol=1e-6)
    np.testing.assert_allclose(puppet.rest[:2], [[0.15, 0, 0.1], [-0.15, 0, 0.1]], atol=1e-6)
    assert [point.name for point in puppet.points] == ["left foot", "right foot", "point 3"]
    assert puppet.points[2].vertex == 300 and puppet.points[2].weight == 2.5 and puppet.points[0].foot
    np.testing.assert_allclose(puppet.poses[0].places[0], puppet.rest[0] + [0, 0.1, 0.2])
    np.testing.assert_array_equal(puppet.poses[0].places[1:], puppet.rest[1:])
    np.testing.assert_array_equal(puppet.poses[1].places[1], [-0.2, 0.05, 0.1])
    assert puppet.poses[1].time == pytest.approx(1.0) and puppet.examples.acceleration == 0.1
    layer = puppet.layers[0]
    assert layer.take == "walk" and layer.loop and layer.speed == 2.0
    assert layer.positions == (Position("point 3", 3, (0.0, 0.5, 0.0), "y"),)
    assert layer.switches == (Switch(0, "contact"),)


@given(st.integers(0, 10**6))
@settings(max_examples=5, deadline=None)
def test_session_survives_writing_and_reading_bit_for_bit(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("session") / "a" / "stool.toml"
    project = full_project(seed)
    write_session(path, project, "stool")
    read = read_session(path)
    assert are_identical(read.project.puppets["stool"], project.puppets["stool"])
    assert are_identical(read.project, project)
    text = path.read_text()
    write_session(path, read.project, "stool", read.mesh, read.takes)
    assert path.read_text() == text


@st.composite
def layers(draw):
    """Draws a layer of the stool with any time map and any of its own settings."""
    when = draw(lanes())
    own = draw(
        st.fixed_dictionaries(
            {
                "take": st.sampled_from(["walk", "short"]),
                "points": st.sampled_from([(), ("top",), ("left hand", "top")]),
                "weight": st.floats(0.0, 1.0),
                "switches": st.sampled_from([None, (), (Switch(0, "flight"), Switch(3, "contact"))]),
                "positions": st.sampled_from([(), (Position("top", 9, (0.0, 1.1, -1e-7)),)]),
                **dict.fromkeys(("muted", "travel", "level_feet", "mirrored"), st.booleans()),
            }
        )
    )
    return PuppetLayer(**{field.name: getattr(when, field.name) for field in fields(TimeMap)}, **own)


@pytest.mark.slow
@given(st.lists(layers(), max_size=4))
@settings(max_examples=25, deadline=None)
def test_layer_survives_writing_and_reading(tmp_path_factory, made):
    path = tmp_path_factory.mktemp("session") / "stool.toml"
    project = puppet_project(poses=0, play=False).with_takes(walker(1, "short"))
    project = project.with_characters(project.puppets["stool"].with_changes(layers=made))
    write_session(path, project, "stool")
    assert are_identical(read_session(path).project.puppets["stool"], project.puppets["stool"])


def test_a_session_can_say_all_that_a_layer_has():
    for table, inside, kind in (
        (LayerTable, INNER_TABLES, PuppetLayer),
        (RootTable, ROOT_INNER_TABLES, RootLayer),
    ):
        sayable = {field.name for field in fields(table)} | {attribute for attribute, _ in inside.values()}
        assert sayable - {"keys"} == {field.name for field in fields(kind)}


@st.composite
def root_layers(draw):
    """Draws a layer that rotates and moves the whole stool, with any time map and any of its own settings."""
    when, small = draw(lanes()), st.floats(-3.0, 3.0)
    own = {
        "take": draw(st.sampled_from(["stool keys", "other keys", "walk"])),
        "about": np.array(draw(st.tuples(small, small, small))),
        "basis": normalized(np.array([1.0, *draw(st.tuples(small, small, small))])),
        "size": draw(st.floats(0.1, 3.0)),
        "weight": draw(st.floats(0.0, 1.0)),
        "mirrored": draw(st.booleans()),
        "muted": draw(st.booleans()),
    }
    return RootLayer(**{field.name: getattr(when, field.name) for field in fields(TimeMap)}, **own)


@pytest.mark.slow
@given(st.lists(root_layers(), min_size=1, max_size=3), st.floats(0.0, 4.0))
@settings(max_examples=25, deadline=None)
def test_root_layers_survive_writing_and_reading(tmp_path_factory, made, second):
    path = tmp_path_factory.mktemp("session") / "stool.toml"
    first = MotionKey(second, (3.0, -20.0, 0.1), "linear", (0.5, 0.0, -1.25))
    clips = [
        clip_from_keys("stool keys", "root", [first, MotionKey(second + 1.0)]),
        clip_from_keys("other keys", "root", [MotionKey(0.5, metres=(1.0, 0.0, 0.0))]),
    ]
    project = puppet_project(poses=0).with_takes(*clips)
    project = project.with_characters(project.puppets["stool"].with_changes(root_layers=tuple(made)))
    write_session(path, project, "stool")
    read = read_session(path).project
    assert are_identical(read.puppets["stool"], project.puppets["stool"])
    for layer in made:
        assert are_identical(read.takes[layer.take], project.takes[layer.take])


def test_a_puppet_that_crosses_the_stage_does_so_after_its_session_is_read():
    """The root keys are made by hand. The second one is a metre to the side."""
    project = key_characters(puppet_project(), ["stool"], 0.0)
    project = key_characters(project, ["stool"], 2.0, (1.0, 0.0, 0.0))
    before = [compute_vertices(project, "stool", time).mean(0) for time in (0.0, 1.0, 2.0)]
    with TemporaryDirectory() as folder:
        write_session(Path(folder) / "stool.toml", project, "stool")
        read = read_session(Path(folder) / "stool.toml")
    after = [compute_vertices(read.project, "stool", time).mean(0) for time in (0.0, 1.0, 2.0)]
    np.testing.assert_allclose(after, before, atol=1e-9)
    still = puppet_project()
    assert after[2][0] - compute_vertices(still, "stool", 2.0).mean(0)[0] == pytest.approx(1.0, abs=1e-6)


def test_files_that_there_are_stay_where_the_mesh_and_the_takes_are(folder):
    """Content that was read from files is not written again, and the puppet is the same."""
    mesh = MeshTable("stool.ply", 1.0)
    loaded = fit_height(load_mesh(folder / "stool.ply").mesh, 1.0)
    project = full_project()
    puppet = project.puppets["stool"].with_changes(mesh=loaded)
    project = project.with_characters(puppet)
    takes = {name: TakeTable("moves.enliven", animation=name) for name in ("walk", "short")}
    write_session(folder / "made.toml", project, "stool", mesh, takes)
    assert not (folder / "made.enliven").exists()
    assert are_identical(read_session(folder / "made.toml").project.puppets["stool"], puppet)
    # A take without a file is saved next to the session.
    write_session(folder / "part.toml", project, "stool", mesh, {"walk": takes["walk"]})
    assert are_identical(read_session(folder / "part.toml").project, project)


def test_unposed_point_is_written_without_offset(folder):
    project = puppet_project(poses=0, play=False)
    rest = project.puppets["stool"].rest
    project = add_key_pose(project, "stool", "walk", 0.5, rest)
    project = add_key_pose(project, "stool", "walk", 1.0, places_for(rest, 1))
    text = session_text(project.puppets["stool"], MeshTable("stool.ply"), {})
    assert text.count("[pose.moves]") == 1 and text.count("[pose.places]") == 1
    assert '"top" = [0.0, 0.0, 0.0]' in text


def test_part_of_a_take_is_read(folder):
    text = BY_HAND.replace(
        'file = "moves.enliven"', 'file = "moves.enliven"\nname = "late"\nstart = 1.0\nend = 2.5'
    )
    (folder / "session.toml").write_text(text.replace('take = "walk"\n', ""))
    read = read_session(folder / "session.toml")
    assert read.project.takes["late"].duration == pytest.approx(1.5)
    assert read.takes["late"].start == 1.0


WRONG = [
    ("[mesh]", "[msh]", "unknown table msh. Did you mean mesh?"),
    ('file = "stool.ply"', 'fiel = "stool.ply"', "[mesh]: unknown key fiel. Did you mean file?"),
    ('file = "stool.ply"', 'file = "stol.ply"', "[mesh]: "),
    ("height = 0.5", 'height = "tall"', "[mesh]: height is 'tall'"),
    ("height = 0.5", "height = 0.0", "[mesh]: height is 0.0, outside"),
    ('file = "moves.enliven"', 'file = "moves.xyz"', "[[take]] 1: "),
    ('file = "moves.enliven"', 'file = "moves.enliven"\nanimation = "run"', "animation 'run' does not exist"),
    ("vertex = 300", "vertex = 30000", "[[point]] 3: puppet 'stool': the mesh has no vertex 30000"),
    ("vertex = 300", "", "the control point needs either a vertex or a position. Set vertex = 4711 or"),
    ("vertex = 300", "at = [0, 1]", "[[point]] 3: at is [0, 1]"),
    ("time = 0.2", "", "[[pose]] 1: the key pose needs either a time or a frame"),
    ("time = 0.2", "time = 99.0", "[[pose]] 1: take 'walk': the time 99 s is outside the take. Choose"),
    ("time = 0.2", "time = 1e308", "is outside the take. Choose a time from 0 to 3 s."),
    ("time = 0.2", "tiem = 0.2", "[[pose]] 1: unknown key tiem. Did you mean time?"),
    ("frame = 30", "frame = 6",
     "[[pose]] 2: puppet 'stool': frame 6 of the take 'walk' already has the key pose 0"),
    ('take = "walk"', 'take = "run"', "[[pose]] 2: the take 'run' does not exist. Known takes: walk."),
    ('"right foot" = [-0.2', '"wrong foot" = [-0.2', "the puppet has no control point 'wrong foot'"),
    ("moves = {", 'places = {"left foot" = [0, 0, 0]}\nmoves = {', "the key pose has both places and moves"),
    ("normal = [1, 0, 0]", "normal = [0, 0, 0]", "[symmetry]: "),
    ("acceleration = 0.1", "accelleration = 0.1", "[settings]: unknown key examples.accelleration. Did"),
    ("acceleration = 0.1", "acceleration = 99.0", "acceleration is 99.0, outside the range 0.0..10.0"),
    ("speed = 2", "speed = 0", "[[layer]] 1: layer of 'walk': the offset 0.0 s or the speed 0.0"),
    ("speed = 2", "sped = 2", "[[layer]] 1: unknown key sped. Did you mean speed?"),
    ("frame = 3\n", "frame = 3000\n",
     "[[layer]] 1: constraints: the position of the control point 'point 3' at frame 3000"),
    ('point = "point 3"', 'point = "nose"', "point 'nose' does not exist. Known control points: left foot,"),
    ('axes = "y"', 'axes = "up"',
     "the position of the control point 'point 3' at frame 3 (up) has the invalid axes"),
    ('kind = "contact"', 'kind = "hop"', "[[layer]] 1, switch 1: kind is 'hop', expected 'contact' or"),
    ("[[layer.switch]]\nframe = 0", "[[layer.switch]]\nframe = 4", "[[layer]] 1: locomotion: the floor"),
    ("[[layer]]", "[layer]", "layer must be an array of tables. Write one table [[layer]] for each entry."),
    ("[symmetry]", "[[symmetry]]", "[symmetry] must be a single table. Write exactly one table [symmetry]."),
    ('joint = "Head"', 'joint = "Tail"', "has no 'Tail'"),
]  # fmt: skip


@pytest.mark.parametrize(("right", "wrong", "said"), WRONG)
def test_error_names_table_key_and_fix(folder, right, wrong, said):
    assert right in BY_HAND
    path = folder / "session.toml"
    path.write_text(BY_HAND.replace(right, wrong, 1))
    with pytest.raises(InputError) as refused:
        read = read_session(path)
        solve_layer_motion(read.project, read.project.puppets["stool"], 0)
    assert said in str(refused.value)


def test_other_files_are_refused(folder):
    with pytest.raises(InputError, match=r"nowhere\.toml: the file does not exist"):
        read_session(folder / "nowhere.toml")
    (folder / "bad.toml").write_text("[mesh\n")
    with pytest.raises(InputError, match=r"the file is not valid TOML"):
        read_session(folder / "bad.toml")
    (folder / "empty.toml").write_text("")
    with pytest.raises(InputError, match=r"no table \[mesh\]"):
        read_session(folder / "empty.toml")
    (folder / "lonely.toml").write_text('[mesh]\nfile = "stool.ply"\n[[pose]]\ntime = 0\n')
    with pytest.raises(InputError, match=r"\[\[pose\]\] 1: the session has no take"):
        read_session(folder / "lonely.toml")
    with pytest.raises(InputError, match="a session file cannot have the suffix"):
        write_session(folder / "made.enliven", full_project(), "stool")


def test_contradictions_are_all_named(folder):
    more = '[[layer.position]]\npoint = "point 3"\nframe = 3\nplace = [0, 0.7, 0]\n'
    (folder / "session.toml").write_text(BY_HAND.replace("[[layer.switch]]", more + "[[layer.switch]]"))
    with pytest.raises(InputError) as refused:
        read_session(folder / "session.toml")
    assert "(xyz) contradicts the position of the control point 'point 3' at frame 3 (y)" in str(
        refused.value
    )


def test_the_same_take_twice_needs_two_names(folder):
    twice = '[[take]]\nfile = "moves.enliven"\n'
    (folder / "session.toml").write_text(BY_HAND.replace("[[take]]", twice + "[[take]]", 1))
    with pytest.raises(InputError, match=r"\[\[take\]\] 2: .*already has a take 'walk'"):
        read_session(folder / "session.toml")
    named = twice + 'name = "again"\n'
    (folder / "session.toml").write_text(BY_HAND + named)
    assert list(read_session(folder / "session.toml").project.takes) == ["walk", "again"]


def test_a_mesh_that_looks_elsewhere_is_turned(folder):
    (folder / "session.toml").write_text(BY_HAND.replace("height = 0.5", "height = 0.5\nturned = 90"))
    low, high = read_session(folder / "session.toml").project.puppets["stool"].mesh.bounds
    # It was 0.3 m wide and 0.2 m deep before.
    np.testing.assert_allclose(high - low, [0.2, 0.5, 0.3], atol=1e-6)


def test_file_path_may_start_with_environment_variable(folder, monkeypatch):
    path = folder / "deeper" / "session.toml"
    path.parent.mkdir()
    text = BY_HAND.replace("stool.ply", "$MODELS/stool.ply").replace(
        "moves.enliven", "${MODELS}/moves.enliven"
    )
    path.write_text(text)
    monkeypatch.delenv("MODELS", raising=False)
    with pytest.raises(InputError) as refused:
        read_session(path)
    assert (
        "[mesh]: $MODELS/stool.ply: the environment variable MODELS is not set. Set MODELS to a folder"
        in str(refused.value)
    )
    monkeypatch.setenv("MODELS", str(folder))
    read = read_session(path)
    assert read.mesh.file == "$MODELS/stool.ply" and list(read.project.takes) == ["walk"]
    write_session(path.parent / "again.toml", read.project, "stool", read.mesh, read.takes)
    assert 'file = "$MODELS/stool.ply"' in (path.parent / "again.toml").read_text()
    assert are_identical(read_session(path.parent / "again.toml").project, read.project)
