"""Tests that no work is lost: saving, opening, asking before discarding, recovery files, and the file
browser.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from in_a_window import in_a_window
from pygltflib import GLTF2
from studio_driver import HeadlessStage, Key, Wait, play

sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "mapping"))
from made_bodies import man, random_motion, shape_with_markers

from enliven.document.project import Project, are_identical
from enliven.errors import InputError, ResourceError
from enliven.exporters.gltf.write import build_glb
from enliven.exporters.performance import Performance
from enliven.exporters.sampling import sample_performance
from enliven.mapping.model_clips import find_played_clip, play_own_clip
from enliven.modeling.edits import rename_character
from enliven.motion.layers.evaluate import Player
from enliven_viewer.studio.app.file_browser import FileBrowser
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.workspace.project_store import ProjectStore
from enliven_viewer.studio.workspace.workspace import Workspace

FILES = Path(__file__).parents[1] / "studio_files_session.py"
KILLED = Path(__file__).parents[1] / "studio_killed.py"
WINDOW_KILLED = Path(__file__).parents[1] / "studio_window_killed.py"


@pytest.fixture
def workspace(make_limb, tmp_path) -> Workspace:
    """Returns a workspace with one unsaved edit."""
    opened = Workspace.new(Editor(), tmp_path / "recovery")
    opened.editor.edit("add", lambda project: project.with_characters(make_limb("limb", 3)))
    return opened


def finished_process() -> int:
    """Returns the id of a process that has ended."""
    done = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True
    )
    return int(done.stdout)


def said(workspace: Workspace) -> str:
    return " | ".join(f"{toast.text} {toast.remedy}" for toast in workspace.editor.toasts.shown)


def test_saved_project_opens_bit_for_bit(workspace: Workspace, tmp_path) -> None:
    path = tmp_path / "work.enliven"
    assert workspace.store.dirty
    workspace.store.save(path)
    saved = workspace.editor.project
    assert not workspace.store.dirty and workspace.store.name == "work"
    workspace.store.new()
    workspace.store.open(path)
    assert are_identical(workspace.editor.project, saved) and not workspace.store.dirty
    workspace.editor.edit("delete", lambda project: project.drop_character("limb"))
    assert workspace.store.dirty
    workspace.editor.undo()
    assert are_identical(workspace.editor.project, saved)


def test_unreadable_file_keeps_the_open_project(workspace: Workspace, tmp_path) -> None:
    before = workspace.editor.project
    (tmp_path / "bad.enliven").write_bytes(b"PK\x03\x04 no more")
    with pytest.raises(InputError):
        workspace.store.open(tmp_path / "bad.enliven")
    assert workspace.editor.project is before and workspace.store.dirty


def test_unwritable_path_is_reported_and_work_stays_unsaved(workspace: Workspace, tmp_path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ResourceError):
        workspace.store.save(tmp_path / "file" / "work.enliven")
    assert workspace.store.dirty and workspace.store.path is None


@pytest.mark.parametrize("wish", ["new", "quit"])
def test_unsaved_work_is_not_discarded_without_asking(workspace: Workspace, tmp_path, wish: str) -> None:
    before = workspace.editor.project
    workspace.actions.do(f"file.{wish}")
    assert workspace.asking == "unsaved" and workspace.editor.project is before and not workspace.ended
    workspace.cancel()
    assert workspace.asking == "" and workspace.editor.project is before and not workspace.ended
    workspace.actions.do(f"file.{wish}")
    workspace.continue_waiting_command(discard=False)
    assert workspace.asking == "save as" and workspace.browser is not None
    workspace.finish_file_dialog(tmp_path / "kept.enliven")
    assert (tmp_path / "kept.enliven").is_file()
    assert workspace.ended if wish == "quit" else "limb" not in workspace.editor.project.shapes


def test_discarding_continues_at_once(workspace: Workspace) -> None:
    workspace.start_project()
    workspace.continue_waiting_command(discard=True)
    assert workspace.editor.project.shapes == {} and "wave" in workspace.editor.project.takes
    workspace.quit()
    assert workspace.ended, "a new project has nothing to lose"


def test_opening_another_project_asks_first(workspace: Workspace, tmp_path) -> None:
    other = Workspace.new(Editor(), tmp_path / "other")
    other.store.save(tmp_path / "other.enliven")
    workspace.open(tmp_path / "other.enliven")
    assert workspace.asking == "unsaved" and "limb" in workspace.editor.project.shapes
    workspace.continue_waiting_command(discard=True)
    assert "limb" not in workspace.editor.project.shapes and workspace.store.name == "other"


def test_work_is_kept_every_few_seconds_and_recovered_by_the_next_studio(workspace: Workspace) -> None:
    store = workspace.store
    store.autosave(store.saved_at + 1.0)
    store.settle()
    assert not store.folder.exists(), "not yet time"
    store.autosave(store.saved_at + 60.0)
    store.settle()
    written = list(store.folder.iterdir())
    assert [path.name for path in written] == [f"recovery-{os.getpid()}.enliven"]
    assert store.list_recoverable() == [], "this studio still runs"
    left = written[0].with_name(f"recovery-{finished_process()}.enliven")
    written[0].rename(left)
    after = Workspace.new(Editor(), store.folder)
    assert after.store.list_recoverable() == [left]
    after.store.recover(left)
    assert are_identical(after.editor.project, workspace.editor.project) and after.store.dirty
    assert after.store.list_recoverable() == [] and len(list(store.folder.iterdir())) == 1
    after.store.close()
    assert list(store.folder.iterdir()) == []


def test_saved_or_unchanged_project_leaves_no_recovery_file(workspace: Workspace, tmp_path) -> None:
    store = workspace.store
    store.autosave(store.saved_at + 60.0)
    store.settle()
    store.save(tmp_path / "work.enliven")
    assert list(store.folder.iterdir()) == []
    store.autosave(store.saved_at + 120.0)
    store.settle()
    assert list(store.folder.iterdir()) == []


def test_unwritable_recovery_file_is_reported(workspace: Workspace, tmp_path) -> None:
    (tmp_path / "in the way").write_text("")
    store = ProjectStore(workspace.editor, tmp_path / "in the way")
    workspace.editor.edit("drop", lambda project: project.drop_character("limb"))
    store.autosave(store.saved_at + 60.0)
    store.settle()
    assert "Ctrl+S" in said(workspace)


def test_unknown_file_type_is_reported_with_known_types(workspace: Workspace, tmp_path) -> None:
    with pytest.raises(InputError, match=r"\.glb"):
        workspace.open(tmp_path / "picture.png")


def test_shapes_go_out_as_glb_and_come_in_again(workspace: Workspace, tmp_path) -> None:
    workspace.open_dialogue("export")
    assert workspace.asking == "export" and workspace.browser is not None
    workspace.finish_file_dialog(tmp_path / "out.glb")
    workspace.editor.background.finish()
    assert "Wrote 1 shape" in said(workspace)
    before = workspace.editor.project.shapes["limb"]
    workspace.open(tmp_path / "out.glb")
    added = next(s for name, s in workspace.editor.project.shapes.items() if name != "limb")
    assert (
        len(added.skeleton) >= len(before.skeleton) - 1 and added.mesh is not None and before.mesh is not None
    )
    tall = [float(np.ptp(shape.mesh.vertices[:, 1])) for shape in (before, added)]
    assert tall[0] == pytest.approx(tall[1], rel=1e-4)
    assert added.place[0] > 0.05, "beside what is there"
    assert workspace.editor.selection.characters == (added.id,), "what was opened is chosen"


def test_empty_export_gives_advice(workspace: Workspace, tmp_path) -> None:
    workspace.store.new()
    workspace.asking = "export"
    with pytest.raises(InputError, match="Sketch"):
        workspace.finish_file_dialog(tmp_path / "out.glb")


def test_the_browser_lists_folders_and_what_can_be_opened(tmp_path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / ".hidden").mkdir()
    for name in ("b.glb", "A.GLB", "c.txt"):
        (tmp_path / name).write_text("")
    browser = FileBrowser(tmp_path, (".glb",))
    assert [path.name for path in browser.folders()] == ["inner"]
    assert [path.name for path in browser.files()] == ["A.GLB", "b.glb"]
    browser.name = "b.glb"
    assert browser.get_path() == tmp_path / "b.glb"
    browser.name = "nothing.glb"
    with pytest.raises(InputError, match="does not exist"):
        browser.get_path()
    browser.enter(tmp_path / "inner")
    assert browser.name == "" and browser.files() == []
    browser.enter(tmp_path / "gone")
    assert browser.files() == [] and "cannot be read" in browser.problem


def test_a_saved_name_gets_its_ending(tmp_path) -> None:
    browser = FileBrowser(tmp_path, (".enliven",), "squid v1.2", saving=True)
    assert browser.get_path() == tmp_path / "squid v1.2.enliven"
    browser.name = "  "
    with pytest.raises(InputError, match="no file"):
        browser.get_path()


def test_a_shape_is_renamed_in_its_place(make_limb) -> None:
    project = Editor().project.with_characters(make_limb("a", 2), make_limb("b", 2))
    renamed = rename_character(project, "a", "mantle")
    assert list(renamed.shapes) == ["mantle", "b"] and renamed.shapes["mantle"].id == "mantle"
    with pytest.raises(InputError, match="already has the name"):
        rename_character(project, "a", "b")


def test_internal_error_is_reported_and_changes_nothing(workspace: Workspace, monkeypatch) -> None:
    monkeypatch.delenv("ENLIVEN_DEBUG", raising=False)
    before = workspace.editor.project
    assert not workspace.editor.edit("break", lambda project: [project][1])
    assert (
        workspace.editor.project is before
        and "enliven has an internal error" in said(workspace)
        and "in test_studio_files.py, line" in said(workspace)
        and "IndexError" not in said(workspace)
    )
    monkeypatch.setenv("ENLIVEN_DEBUG", "1")
    with pytest.raises(IndexError):
        workspace.editor.edit("break", lambda project: [project][1])


def test_file_is_replaced_only_after_confirmation(tmp_path) -> None:
    (tmp_path / "old.enliven").write_text("precious")
    browser = FileBrowser(tmp_path, (".enliven",), "old", saving=True)
    with pytest.raises(InputError, match="Save again"):
        browser.get_path()
    assert browser.get_path() == tmp_path / "old.enliven"
    own = FileBrowser(tmp_path, (".enliven",), "old", saving=True, project_path=tmp_path / "old.enliven")
    assert own.get_path() == tmp_path / "old.enliven"


@pytest.mark.slow
def test_files_are_saved_dropped_filmed_and_opened_again_in_the_window(tmp_path) -> None:
    report = in_a_window(FILES, str(tmp_path))
    assert report["done"], report
    assert report["at first"] == "Untitled - enliven" and report["changed"] == "*Untitled - enliven"
    assert report["saved"] == ["Untitled - enliven", "", True], "Ctrl+S and Enter save at once"
    assert report["saved as"] == ["squid - enliven", ""]
    assert report["warns"] == ["save as", True] and report["replaced"] == ["squid - enliven", ""]
    assert report["dropped"] == ["limb", "limb 2", "post", "star"] and "nothing.glb" in report["told"][0]
    first, none, again = report["clip"]
    assert first and none is None and again == first, "the clip of a model is chosen at the right"
    assert report["recent"] == ["limb.glb", "squid.enliven", "Untitled.enliven"]
    assert report["film"] == ["squid.mp4"] and "Wrote 2 shapes to squid.mp4" in report["film told"]
    assert report["heard"] == pytest.approx(20_000, rel=0.1), "as loud as the tone"
    assert report["went on"] and report["still drawn"] > 5, "the window goes on while a film is written"
    assert report["recent asks"] == "unsaved"
    assert report["opened"] == ["squid - enliven", ["squid.enliven", "limb.glb", "Untitled.enliven"]]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="studios are forked to be killed")
@pytest.mark.slow
def test_50_studios_killed_at_random_moments_lose_20_seconds_at_most(tmp_path) -> None:
    command = [sys.executable, str(KILLED), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    lost = [(reported - recovered) * report["tick"] for reported, recovered in report["results"]]
    assert len(lost) == 50 and max(lost) <= 20.0
    assert sum(recovered > 0 for _, recovered in report["results"]) > 10, "many had a recovery file"
    assert len(set(reported for reported, _ in report["results"])) > 5, "they were killed at many moments"
    assert all(name.count("recovery") == 0 for name in report["left"]), report["left"]


@pytest.mark.slow
def test_real_windows_killed_at_random_moments_give_back_all_but_the_last_seconds(tmp_path) -> None:
    """The test kills a single window. `make test-long` kills 50."""
    kills = os.environ.get("ENLIVEN_KILLS", "1")
    report = in_a_window(WINDOW_KILLED, str(tmp_path), kills, seconds=120.0 + 30.0 * int(kills))
    assert all(kill["lost_s"] <= 20.0 for kill in report["results"]), report
    # Edits before the last recovery file are never lost, however soon the kill follows.
    assert all(kill["kept"] > 0 for kill in report["results"] if kill["worked_s"] > 6 * report["autosave"]), (
        report
    )
    assert all(kill["kept"] <= kill["told"] + 1 for kill in report["results"]), report


def model_with_clips(path: Path, *loops: bool, seed: int = 2) -> Path:
    """Writes a man with clips "clip 0", "clip 1" ..., which loop or not."""
    random, skeleton = np.random.default_rng(seed), man()
    shape, performances = shape_with_markers("man", skeleton), []
    for number, loop in enumerate(loops):
        clip = random_motion(random, skeleton, 6, 0.2, f"clip {number}")
        back = clip.map_values(lambda track: np.concatenate([track, track[-2::-1]])) if loop else clip
        project = Project().with_characters(shape).with_takes(back)
        performances.append(
            sample_performance(play_own_clip(project, "man", back.id), "man", 0.0, back.duration, 10.0)
        )
    write_clips(path, [f"clip {number}" for number in range(len(loops))], performances)
    return path


def write_clips(path: Path, names: list[str], performances: list[Performance]) -> None:
    """Writes performances of one character as one model, with one animation for each performance."""
    whole = GLTF2.load_from_bytes(build_glb([performances[0]]))
    blob = bytearray(whole.binary_blob() or b"")
    for performance in performances[1:]:
        other = GLTF2.load_from_bytes(build_glb([performance]))
        views, accessors = len(whole.bufferViews), len(whole.accessors)
        for view in other.bufferViews:
            view.byteOffset = (view.byteOffset or 0) + len(blob)
        for accessor in other.accessors:
            accessor.bufferView += views
        for sampler in other.animations[0].samplers:
            sampler.input, sampler.output = sampler.input + accessors, sampler.output + accessors
        whole.bufferViews += other.bufferViews
        whole.accessors += other.accessors
        whole.animations += other.animations
        blob += other.binary_blob() or b""
    for animation, name in zip(whole.animations, names, strict=True):
        animation.name = name
    whole.buffers[0].byteLength = len(blob)
    whole.set_binary_blob(bytes(blob))
    path.write_bytes(b"".join(whole.save_to_bytes()))


def test_a_model_that_is_opened_plays_its_clip_on_space_again_and_again(tmp_path) -> None:
    opened = Workspace.new(Editor(), tmp_path / "recovery")
    opened.open(model_with_clips(tmp_path / "man.glb", False, True))
    editor = opened.editor
    assert "Space plays clip 1. The model has 2 clips: choose a clip at the right." in said(opened)
    assert not editor.playing and find_played_clip(editor.project, editor.project.shape("man")) == "clip 1"
    play([Key("space"), Wait(0.25)], HeadlessStage(opened))
    assert editor.playing and editor.time > 0.2
    clip, player = editor.project.takes["clip 1"], Player(editor.project, "man")
    rounds = editor.length / clip.duration
    assert rounds >= 1.0 and rounds == pytest.approx(round(rounds)), "the project ends with a round"
    times = np.linspace(0.0, clip.duration, 7)[:-1]
    np.testing.assert_allclose(player.sample(times)[1], player.sample(times + clip.duration)[1], atol=1e-5)
    seam = player.sample(np.array([-1e-4, 1e-4]) + clip.duration)[1]
    assert np.abs(seam[1] - seam[0]).max() < 1e-2, "nothing jumps where it begins again"
    assert editor.history.names == ("open man.glb",)


def test_two_models_with_clips_of_one_name_keep_their_own(tmp_path) -> None:
    opened = Workspace.new(Editor(), tmp_path / "recovery")
    first, other = tmp_path / "man.glb", tmp_path / "other.glb"
    opened.open(model_with_clips(first, True))
    opened.open(model_with_clips(other, True, seed=5))
    opened.open(first)
    project = opened.editor.project
    takes = [find_played_clip(project, project.shape(name)) for name in ("man", "other", "man 2")]
    assert takes == ["clip 0", "clip 0 1", "clip 0"], "one file opened twice has its clips once"
    ends = [Player(project, name).compute_pose(0.3).turns for name in ("man", "other", "man 2")]
    assert np.abs(ends[1] - ends[0]).max() > 0.01 and np.abs(ends[2] - ends[0]).max() < 1e-9


def test_recent_files_are_kept_between_runs_and_opened_again(workspace: Workspace, tmp_path) -> None:
    assert "Ctrl+O" in workspace.actions["file.again"].why_not()
    workspace.save_or_ask()
    workspace.finish_file_dialog(tmp_path / "work.enliven")
    after = Workspace.new(Editor(), tmp_path / "recovery")
    assert [Path(name).name for name in after.preferences.recent] == ["work.enliven"]
    assert after.actions.do("file.again") and "limb" in after.editor.project.shapes
    (tmp_path / "work.enliven").unlink()
    assert after.actions.do("file.again") and "the file does not exist" in said(after)


def test_a_save_that_fails_does_not_quit_later(workspace: Workspace, tmp_path) -> None:
    (tmp_path / "file").write_text("in the way")
    workspace.quit()
    workspace.continue_waiting_command(discard=False)
    with pytest.raises(ResourceError):
        workspace.finish_file_dialog(tmp_path / "file" / "work.enliven")
    workspace.save_or_ask()
    workspace.finish_file_dialog(tmp_path / "work.enliven")
    assert not workspace.ended and not workspace.store.dirty


def depth_recording(folder, frames: int):
    """Writes the first images of the shipped depth recording."""
    from itertools import islice

    from enliven.recording import Recorder, Recording
    from enliven_edge.doctor import find_shipped_recording

    path = folder / "person.mcap"
    with Recorder(path) as recorder:
        for frame in islice(Recording(find_shipped_recording()).frames(), frames):
            recorder.write_frame(frame)
    return path


@pytest.mark.slow
def test_opened_depth_is_tracked_in_the_background_into_a_take(workspace, tmp_path) -> None:
    path, editor = depth_recording(tmp_path, 40), workspace.editor
    workspace.open(path)
    assert (
        workspace.depth.busy
        and workspace.depth.name == "person.mcap"
        and "person" not in editor.project.takes
    )
    with pytest.raises(InputError, match="still being tracked"):
        workspace.open(path)
    workspace.depth.finish()
    assert "person" in editor.project.takes and workspace.depth.share == 1.0 and not workspace.depth.busy
    assert editor.project.takes["person"].duration > 0.9
    editor.undo()
    assert "person" not in editor.project.takes
    workspace.open(path)
    workspace.depth.cancel()
    workspace.depth.poll()
    assert not workspace.depth.busy and "person" not in editor.project.takes
    (tmp_path / "short").mkdir()
    workspace.open(depth_recording(tmp_path / "short", 3))
    workspace.depth.finish()
    assert any(toast.is_error and "long enough" in toast.text for toast in editor.toasts.shown)
