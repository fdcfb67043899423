"""Tests that files of enliven 0.1 can be opened, and that files of a later version are refused and kept
unchanged.

The folder versions/0.1 was written by a commit of version 0.1 and is never regenerated. Its settings contain
every key, and its preferences every action. A renamed key or action therefore fails unless old files are
still read. Projects of every version are in tests/shared/formats/projects.
"""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path

import pytest

from enliven import __version__, cli
from enliven.errors import InputError, LaterVersionError
from enliven.example_sessions.session import read_session
from enliven.example_sessions.text import write_session
from enliven.formats.project.file import read_project
from enliven.frames import DepthFrame
from enliven.mapping.plan_file import read_plan, write_plan
from enliven.motion_clips.recorded_characters import read_possessed
from enliven.motion_clips.tracked_people import read_recorded_clips
from enliven.recording import Recorder, Recording, recover, schemas
from enliven.recording.container import open_container
from enliven.settings import load_settings
from enliven.space.space_file import load_space, save_space
from enliven_edge.doctor import find_shipped_recording
from enliven_edge.sensors.stereo.calibration import load_calibration, save_calibration
from enliven_edge.settings import EdgeSettings
from enliven_viewer.settings import ViewerSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.preferences import Preferences
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.workspace.project_store import ProjectStore
from enliven_viewer.studio.workspace.workspace import Workspace

STORED = Path(__file__).parent / "versions" / "0.1"
TOML_READERS = {
    "edge.toml": lambda path: load_settings(EdgeSettings, path),
    "viewer.toml": lambda path: load_settings(ViewerSettings, path),
    "studio.toml": lambda path: load_settings(StudioSettings, path),
    "plan.toml": read_plan,
    "space.toml": load_space,
    "stereo.toml": load_calibration,
    "session.toml": read_session,
}


@pytest.fixture
def stored(tmp_path) -> Path:
    """Returns a copy of the files of enliven 0.1."""
    return Path(shutil.copytree(STORED, tmp_path / "0.1"))


@pytest.mark.parametrize("name", TOML_READERS)
def test_settings_of_0_1_are_read(stored, name):
    assert TOML_READERS[name](stored / name) is not None


def test_values_of_0_1_are_kept(stored):
    assert load_settings(EdgeSettings, stored / "edge.toml").tracker.scene.far == 4.5
    assert load_space(stored / "space.toml").sensors["kinect2-138"].clock_offset_ns == -12345
    assert load_calibration(stored / "stereo.toml").baseline == 0.075
    assert read_plan(stored / "plan.toml").chains[0].source == ("Chest", "Head")
    assert list(read_session(stored / "session.toml").project.puppets) == ["cactus"]
    assert list(read_project(stored / "session.enliven").puppets) == ["cactus"]


def test_a_performance_of_0_1_is_edited_and_retargeted(stored):
    path = stored / "performance.mcap"
    assert open_container(path).library == "enliven 0.1.0"
    assert list(read_possessed(path).graphs) == ["post"]
    assert read_recorded_clips(path)[0].duration > 0.5


def test_a_depth_recording_of_0_1_is_read():
    path = find_shipped_recording()
    assert open_container(path).library == "enliven 0.1.0"
    assert isinstance(next(iter(Recording(path).frames())), DepthFrame)


def test_preferences_and_keys_of_0_1_are_used(stored):
    kept = Preferences(stored)
    assert kept.refusal is None and kept.recent == ["/home/ada/chair.enliven"]
    assert (kept.text_size, kept.timeline_height, kept.toured) == (1.3, 321.0, True)
    workspace = Workspace.new(Editor(), stored)
    assert workspace.actions.find_shortcuts(workspace.actions["view.light_theme"]) == ("ctrl+f11",)
    lost = [action for action in kept.keys if action not in workspace.actions]
    assert not lost, "these actions have another id: give Preferences a table of old ids"


@pytest.mark.parametrize("name", TOML_READERS)
def test_settings_of_a_later_version_are_refused(stored, name):
    path = stored / name
    text = "version = 2\n" + path.read_text().replace("version = 1\n", "") + '\n[later]\nkey = "value"\n'
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        TOML_READERS[name](path)
    message = str(refused.value)
    assert message == (
        f"{path}: the file has the later format version 2. "
        f"This is enliven {__version__}, which reads files up to version 1. Update enliven."
    )
    assert path.read_text() == text


TOML_WRITERS = {
    "plan.toml": lambda path: write_plan(read_plan(STORED / path.name), path),
    "space.toml": lambda path: save_space(path, load_space(STORED / path.name), []),
    "stereo.toml": lambda path: save_calibration(path, load_calibration(STORED / path.name), []),
    "session.toml": lambda path: write_session(path, read_project(STORED / "session.enliven"), "cactus"),
}


@pytest.mark.parametrize("name", TOML_WRITERS)
def test_files_of_a_later_version_are_not_replaced(tmp_path, name):
    path = tmp_path / name
    path.write_text("version = 2\n")
    with pytest.raises(LaterVersionError, match="later format version 2"):
        TOML_WRITERS[name](path)
    assert path.read_text() == "version = 2\n" and [file.name for file in tmp_path.iterdir()] == [name]
    path.write_text("something else")
    TOML_WRITERS[name](path)
    assert TOML_READERS[name](path) is not None


def test_the_studio_does_not_save_over_a_project_of_a_later_version(tmp_path):
    path = tmp_path / "later.enliven"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("project.json", '{"format": "enliven project", "version": 9, "made_by": "9.9"}')
    before = path.read_bytes()
    store = ProjectStore(Editor(), tmp_path)
    for step in (lambda: store.open(path), lambda: store.save(path), lambda: store.save(path, over=True)):
        with pytest.raises(LaterVersionError, match="later format version 9, written by enliven 9"):
            step()
    assert path.read_bytes() == before


@pytest.mark.parametrize("version", ["0", "true", '"new"', "1.5"])
def test_invalid_version_is_refused(tmp_path, version):
    (tmp_path / "edge.toml").write_text(f"version = {version}\n")
    with pytest.raises(InputError, match="expected a whole number of at least 1"):
        load_settings(EdgeSettings, tmp_path / "edge.toml")


@pytest.fixture(params=["whole", "cut off"])
def later_recording(request, tmp_path, monkeypatch) -> Path:
    """Writes a recording of a later version."""
    path = tmp_path / "later.mcap"
    with monkeypatch.context() as patch:
        patch.setattr("enliven.recording.recorder.__version__", "0.9.0")
        patch.setitem(schemas.ABOUT, schemas.VERSION_KEY, "2")
        frame = next(iter(Recording(find_shipped_recording()).frames()))
        with Recorder(path) as recorder:
            for _ in range(3):
                recorder.write_frame(frame)
    if request.param == "cut off":
        path.write_bytes(path.read_bytes()[:-100])
    return path


def test_a_recording_of_a_later_version_is_refused(later_recording):
    before = later_recording.read_bytes()
    for read in (Recording, read_possessed, read_recorded_clips):
        with pytest.raises(InputError, match=r"format version 2, written by enliven 0\.9\.0.*Update enliven"):
            read(later_recording)
    output = later_recording.with_name("recovered.mcap")
    with pytest.raises(InputError, match=r"format version 2, written by enliven 0\.9\.0.*Update enliven"):
        recover(later_recording, output)
    assert later_recording.read_bytes() == before and not output.exists()


@pytest.mark.parametrize(
    "words", ["edge --recording {} --port 0", "inspect {}", "recover {} -o out.mcap", "replay {}"]
)
def test_commands_refuse_a_later_recording_in_one_line(later_recording, words, capsys):
    assert cli.run(words.format(later_recording).split()) == 3
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "format version 2" in line and line.endswith("Update enliven.")


def test_a_recording_states_its_version(tmp_path):
    with Recorder(tmp_path / "a.mcap"):
        pass
    metadata = Recording(tmp_path / "a.mcap").info.metadata
    assert metadata[schemas.ABOUT_NAME][schemas.VERSION_KEY] == str(schemas.RECORDING_VERSION)


def test_preferences_of_a_later_version_are_kept(tmp_path):
    path = tmp_path / "preferences.json"
    path.write_text('{"version": 2, "keys": {"view": {"light": "f9"}}, "theme": {"name": "dusk"}}')
    before = path.read_bytes()
    workspace = Workspace.new(Editor(), tmp_path)
    workspace.preferences.resize(2)
    workspace.preferences.remember_file(tmp_path / "a.enliven")
    assert workspace.preferences.text_size > 1.0, "choices hold until the program ends"
    assert path.read_bytes() == before and [file.name for file in tmp_path.iterdir()] == [path.name]
    shown = [f"{toast.text}. {toast.remedy}" for toast in workspace.editor.toasts.shown]
    assert any("format version 2" in text and text.endswith("Update enliven.") for text in shown)


def test_entries_of_a_later_program_stay_in_preferences(tmp_path):
    path = tmp_path / "preferences.json"
    later = {"keys": {"later.action": ["f9"]}, "theme": "dusk", "brush": {"size": 3}, "text_size": 1.3}
    path.write_text(json.dumps(later))
    kept = Preferences(tmp_path)
    assert kept.theme == "dark", "an unknown theme is not used"
    kept.keys["view.all"] = ("f8",)
    kept.resize(1)
    stored = json.loads(path.read_text())
    assert stored["theme"] == "dusk" and stored["brush"] == {"size": 3} and stored["text_size"] == 1.5
    assert stored["keys"] == {"later.action": ["f9"], "view.all": ["f8"]} and stored["version"] == 1
    kept.set_colours(theme="light")
    kept.resize(-1)
    stored = json.loads(path.read_text())
    assert stored["theme"] == "light" and stored["text_size"] == 1.3 and stored["brush"] == {"size": 3}
