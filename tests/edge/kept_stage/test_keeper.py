"""Tests that the stage is restored after a restart: characters, sizes, switches, and after file damage."""

import json
import logging
import subprocess
import sys
import textwrap
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair

from enliven.errors import EnlivenError
from enliven.formats.project.one_character import character_bytes, project_of_mesh
from enliven.wire import Lock, PlayPhysics, RemoveCharacter, Resize, Smooth
from enliven_edge.character_upload import CharacterUploads
from enliven_edge.kept_stage.folder import StageFolder, stage_folder
from enliven_edge.kept_stage.keeper import StageKeeper
from enliven_edge.kept_stage.state import StageState
from enliven_edge.orders import create_handlers
from enliven_edge.physics.switch import PhysicsSwitch
from enliven_edge.settings import EdgeSettings
from enliven_edge.stage.character_setup import create_mesh_actor
from enliven_edge.stage.sizing import HandSizing
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker

from ..test_character_upload import order_of, send

SETTINGS = EdgeSettings(nodes=16)
MESHES = {size: make_chair(size) for size in (0.05, 0.06)}
DATA = [character_bytes(project_of_mesh(mesh, "x"), "x") for mesh in MESHES.values()]
MORE = character_bytes(project_of_mesh(make_chair(0.07), "x"), "x")
INITIAL = {"chair": "chair", "lamp": "lamp.obj"}


@dataclass
class Parts:
    """The parts of an edge that requests change, without its network and camera."""

    keeper: StageKeeper
    stage: Stage = field(init=False)
    now: float = 0.0

    def __post_init__(self) -> None:
        initial = [name for name in INITIAL if not self.keeper.is_removed(name)]
        mesh = MESHES[0.05]
        actors = [create_mesh_actor(mesh, name, 16, SETTINGS.actor, fit=False) for name in initial]
        self.stage = Stage(actors)
        self.uploads = CharacterUploads(self.stage, SETTINGS)
        self.tracker, self.sizing, self.physics = Tracker(), HandSizing(self.stage), PhysicsSwitch()
        self.scans = self.controls = None
        self.handlers = create_handlers(self)
        self.keeper.restore(self)

    def carry_out(self, order) -> None:
        """Executes a request. A refused request changes nothing."""
        try:
            self.handlers[type(order)].apply(order)
        except EnlivenError:
            return

    def capture(self) -> StageState:
        return self.keeper.capture_state(self)


def start(folder: Path) -> Parts:
    return Parts(StageKeeper(StageFolder(folder), INITIAL, SETTINGS))


def restart(parts: Parts, folder: Path) -> Parts:
    """Stops the parts like a stopped edge, and starts new ones with the same folder."""
    parts.keeper.close()
    return start(folder)


NAMES = st.sampled_from(["chair", "lamp", "a", "b"])
ORDERS = st.one_of(
    st.tuples(NAMES, st.integers(0, 1)),
    NAMES.map(RemoveCharacter),
    st.builds(lambda name, size: Resize("set", name, size=size), NAMES, st.sampled_from([0.5, 1.0, 1.75])),
    st.builds(
        lambda name, more: Resize("exaggerate", name, exaggeration=more),
        NAMES,
        st.sampled_from([0.0, 1.5, None]),
    ),
    st.builds(Smooth, st.integers(1, 3), st.sampled_from([0.0, 2.5, None])),
    st.booleans().map(Lock),
    st.sampled_from(["none", "boxes", "dodgeball"]).map(PlayPhysics),
)


@pytest.mark.slow
@settings(max_examples=10, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(ORDERS, max_size=7))
def test_state_after_a_restart_equals_the_state_before(tmp_path_factory, orders) -> None:
    folder = tmp_path_factory.mktemp("stage")
    parts, revision = start(folder), 0
    for order in orders:
        if isinstance(order, tuple):
            name, which = order
            revision += 1
            send(parts.uploads, DATA[which], order_of(DATA[which], name, revision))
        else:
            parts.carry_out(order)
    before, shapes = parts.capture(), parts.stage.characters
    parts = restart(parts, folder)
    assert parts.capture() == before
    again = parts.stage.characters
    assert list(again) == list(shapes)
    for name, shape in shapes.items():
        assert again[name].vertices.tobytes() == shape.vertices.tobytes()
    parts.keeper.close()


@pytest.mark.slow
def test_scanned_character_comes_back(tmp_path) -> None:
    parts = start(tmp_path)
    parts.stage.place_actor(create_mesh_actor(MESHES[0.06], "scan", 16, SETTINGS.actor, fit=False))
    shape = parts.stage.characters["scan"]
    parts = restart(parts, tmp_path)
    again = parts.stage.characters["scan"]
    assert again.vertices.tobytes() == shape.vertices.tobytes() and (again.faces == shape.faces).all()
    assert list(parts.stage.actors) == ["chair", "lamp", "scan"]
    parts = restart(parts, tmp_path)
    assert "scan" in parts.stage.actors, "it is kept again as an uploaded character"
    parts.keeper.close()


def put_guest(folder: Path) -> str:
    """Stores a stage with the character "guest" and returns the name of its data file."""
    parts = start(folder)
    send(parts.uploads, DATA[0], order_of(DATA[0], "guest"))
    parts.keeper.close()
    (data,) = (path.name for path in folder.glob("*.character"))
    return data


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", None),
        ("{", "damaged"),
        ("[]", "damaged"),
        ('{"version": 1, "characters": [{"id": "x", "growth": -1}]}', "damaged"),
        ('{"version": 1, "characters": 5}', "damaged"),
        ('{"version": 99, "actors": []}', "later version"),
    ],
    ids=("empty", "cut", "list", "value", "type", "newer"),
)
def test_state_that_cannot_be_used_is_set_aside(tmp_path, caplog, text, reason) -> None:
    put_guest(tmp_path)
    (tmp_path / "stage.json").write_text(text)
    with caplog.at_level(logging.WARNING):
        parts = start(tmp_path)
    assert list(parts.stage.actors) == ["chair", "lamp"]
    aside = tmp_path / "stage.json.aside"
    assert aside.exists() == (reason is not None)
    if reason is not None:
        assert aside.read_text() == text and reason in caplog.text
    parts.keeper.close()
    assert json.loads((tmp_path / "stage.json").read_text())["version"] == 1


@pytest.mark.slow
@pytest.mark.parametrize("harm", ["missing", "changed", "cut"])
def test_damaged_character_is_left_out_and_the_others_come_back(tmp_path, caplog, harm) -> None:
    data = tmp_path / put_guest(tmp_path)
    parts = start(tmp_path)
    send(parts.uploads, DATA[1], order_of(DATA[1], "other"))
    parts.keeper.close()
    content = data.read_bytes()
    if harm == "missing":
        data.unlink()
    else:
        data.write_bytes(content[:-9] if harm == "cut" else content[:-1] + bytes([content[-1] ^ 1]))
    with caplog.at_level(logging.WARNING):
        parts = start(tmp_path)
    assert list(parts.stage.actors) == ["chair", "lamp", "other"]
    assert "the saved character guest is not restored" in caplog.text
    assert data.with_name(f"{data.name}.aside").exists() == (harm != "missing")
    parts.keeper.close()


@pytest.mark.slow
def test_folder_that_cannot_be_written_only_warns(tmp_path, caplog) -> None:
    (tmp_path / "file").write_text("")
    parts = start(tmp_path / "file" / "below")
    send(parts.uploads, DATA[0], order_of(DATA[0], "guest"))
    parts.keeper.close()
    assert "guest" in parts.stage.actors
    assert "the stage could not be saved" in caplog.text


@pytest.mark.slow
def test_deleted_characters_leave_no_data(tmp_path) -> None:
    put_guest(tmp_path)
    (tmp_path / "note.txt").write_text("of the user")
    parts = start(tmp_path)
    parts.carry_out(RemoveCharacter("guest"))
    parts.keeper.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["note.txt", "stage.json", "start.json"]


CRASHING = """
    import os, sys
    from pathlib import Path
    import enliven_edge.uploaded_actor as module
    from enliven_edge.kept_stage.folder import StageFolder
    from enliven_edge.kept_stage.keeper import StageKeeper
    from enliven_edge.character_upload import CharacterUploads
    from enliven_edge.physics.switch import PhysicsSwitch
    from enliven_edge.settings import EdgeSettings
    from enliven_edge.stage.stage import Stage
    from enliven_edge.tracking.tracker import Tracker

    class Parts:
        stage = Stage()
        uploads = CharacterUploads(stage, EdgeSettings(nodes=16))
        tracker, physics = Tracker(), PhysicsSwitch()

    bad, when = sys.argv[2:]
    create = module.create_uploaded_actor

    def crash(data, order, *rest):
        if order.id == bad and when == "prepared":
            os._exit(139)
        return create(data, order, *rest)

    module.create_uploaded_actor = crash
    now = [0.0]
    keeper = StageKeeper(StageFolder(Path(sys.argv[1])), {}, EdgeSettings(nodes=16), lambda: now[0])
    keeper.restore(Parts)
    for _ in range(200):
        now[0] += 0.1
        keeper.follow(0)
        if bad in Parts.stage.actors and when == "performed":
            os._exit(139)
    print(*Parts.stage.actors)
    keeper.close()
"""


@pytest.mark.slow
@pytest.mark.parametrize(("when", "crashes"), [("prepared", 2), ("performed", 3)])
def test_character_that_crashes_the_edge_twice_is_left_out(tmp_path, when, crashes) -> None:
    """A crash during frames does not reveal its character, so finding it takes one more start."""
    parts = start(tmp_path)
    for name, data in (("good", DATA[0]), ("bad", DATA[1]), ("fine", MORE)):
        send(parts.uploads, data, order_of(data, name))
    parts.carry_out(RemoveCharacter("chair"))
    parts.carry_out(RemoveCharacter("lamp"))
    parts.keeper.close()
    command = [sys.executable, "-c", textwrap.dedent(CRASHING), str(tmp_path), "bad", when]
    for _ in range(crashes):
        assert subprocess.run(command, timeout=300).returncode == 139
    ended = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert ended.stdout.split() == ["good", "fine"], ended.stderr
    assert "edge crashed 2 times" in ended.stderr
    assert len(list(tmp_path.glob("*.aside"))) == 1


def test_folder_is_chosen_by_option_then_setting_then_unit(tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    assert stage_folder(None, "", None, "edge") is None
    monkeypatch.setenv("STATE_DIRECTORY", "/var/lib/enliven:/var/lib/other")
    assert stage_folder(None, "", None, "a b/c") == Path("/var/lib/enliven/stage-a-b-c")
    assert stage_folder(None, "kept", tmp_path, "edge") == tmp_path / "kept" / "stage-edge"
    assert stage_folder(tmp_path, "kept", None, "edge") == tmp_path / "stage-edge"
