"""No work is lost: saving, opening, asking before discarding, recovery files; and the file browser."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from enliven.document.project import same
from enliven.errors import InputError, ResourceError
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.workspace.file_browser import Browser
from enliven_viewer.studio.workspace.project_store import Cabinet
from enliven_viewer.studio.workspace.renaming import renamed
from enliven_viewer.studio.workspace.workspace import Desk


@pytest.fixture
def desk(make_limb, tmp_path) -> Desk:
    """A desk with one edit that is not saved."""
    made = Desk.new(Editor(), tmp_path / "recovery")
    made.editor.edit("add", lambda project: project.with_shapes(make_limb("limb", 3)))
    return made


def finished_process() -> int:
    """The number of a process that is no more."""
    done = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True
    )
    return int(done.stdout)


def said(desk: Desk) -> str:
    return " | ".join(f"{toast.text} {toast.mend}" for toast in desk.editor.toasts.shown)


def test_what_is_saved_is_opened_bit_for_bit(desk: Desk, tmp_path) -> None:
    path = tmp_path / "work.enliven"
    assert desk.cabinet.dirty
    desk.cabinet.save(path)
    saved = desk.editor.project
    assert not desk.cabinet.dirty and desk.cabinet.name == "work"
    desk.cabinet.new()
    desk.cabinet.open(path)
    assert same(desk.editor.project, saved) and not desk.cabinet.dirty
    desk.editor.edit("delete", lambda project: project.without_shape("limb"))
    assert desk.cabinet.dirty
    desk.editor.undo()
    assert same(desk.editor.project, saved)


def test_a_file_that_cannot_be_read_leaves_what_is_open(desk: Desk, tmp_path) -> None:
    before = desk.editor.project
    (tmp_path / "bad.enliven").write_bytes(b"PK\x03\x04 no more")
    with pytest.raises(InputError):
        desk.cabinet.open(tmp_path / "bad.enliven")
    assert desk.editor.project is before and desk.cabinet.dirty


def test_a_place_that_cannot_be_written_is_said_and_the_work_stays_unsaved(desk: Desk, tmp_path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ResourceError):
        desk.cabinet.save(tmp_path / "file" / "work.enliven")
    assert desk.cabinet.dirty and desk.cabinet.path is None


@pytest.mark.parametrize("wish", ["new", "quit"])
def test_nothing_is_thrown_away_without_asking(desk: Desk, tmp_path, wish: str) -> None:
    before = desk.editor.project
    desk.ask(wish)
    assert desk.asking == "unsaved" and desk.editor.project is before and not desk.over
    desk.cancel()
    assert desk.asking == "" and desk.editor.project is before and not desk.over
    desk.ask(wish)
    desk.go_on(discard=False)
    assert desk.asking == "save as" and desk.browser is not None
    desk.chosen(tmp_path / "kept.enliven")
    assert (tmp_path / "kept.enliven").is_file()
    assert desk.over if wish == "quit" else "limb" not in desk.editor.project.shapes


def test_discarding_goes_on_at_once(desk: Desk) -> None:
    desk.ask("new")
    desk.go_on(discard=True)
    assert desk.editor.project.shapes == {} and "wave" in desk.editor.project.takes
    desk.ask("quit")
    assert desk.over, "a new project has nothing to lose"


def test_opening_another_project_asks_first(desk: Desk, tmp_path) -> None:
    other = Desk.new(Editor(), tmp_path / "other")
    other.cabinet.save(tmp_path / "other.enliven")
    desk.open(tmp_path / "other.enliven")
    assert desk.asking == "unsaved" and "limb" in desk.editor.project.shapes
    desk.go_on(discard=True)
    assert "limb" not in desk.editor.project.shapes and desk.cabinet.name == "other"


def test_work_is_kept_every_few_seconds_and_recovered_by_the_next_studio(desk: Desk) -> None:
    cabinet = desk.cabinet
    cabinet.keep(cabinet._since + 1.0)
    assert not cabinet.folder.exists(), "not yet time"
    cabinet.keep(cabinet._since + 60.0)
    written = list(cabinet.folder.iterdir())
    assert [path.name for path in written] == [f"recovery-{os.getpid()}.enliven"]
    assert cabinet.recoverable() == [], "this studio still runs"
    left = written[0].with_name(f"recovery-{finished_process()}.enliven")
    written[0].rename(left)
    after = Desk.new(Editor(), cabinet.folder)
    assert after.cabinet.recoverable() == [left]
    after.cabinet.recover(left)
    assert same(after.editor.project, desk.editor.project) and after.cabinet.dirty
    assert after.cabinet.recoverable() == [] and len(list(cabinet.folder.iterdir())) == 1
    after.cabinet.close()
    assert list(cabinet.folder.iterdir()) == []


def test_nothing_is_kept_of_what_is_saved_or_unchanged(desk: Desk, tmp_path) -> None:
    cabinet = desk.cabinet
    cabinet.keep(cabinet._since + 60.0)
    cabinet.save(tmp_path / "work.enliven")
    assert list(cabinet.folder.iterdir()) == []
    cabinet.keep(cabinet._since + 120.0)
    assert list(cabinet.folder.iterdir()) == []


def test_a_recovery_file_that_cannot_be_written_is_said(desk: Desk, tmp_path) -> None:
    (tmp_path / "in the way").write_text("")
    cabinet = Cabinet(desk.editor, tmp_path / "in the way")
    cabinet._saved = cabinet._kept = desk.editor.project.without_shape("limb")
    cabinet.keep(cabinet._since + 60.0)
    assert "Ctrl+S" in said(desk)


def test_an_unknown_kind_of_file_is_said_with_those_that_are_known(desk: Desk, tmp_path) -> None:
    with pytest.raises(InputError, match=r"\.glb"):
        desk.open(tmp_path / "picture.png")


def test_shapes_go_out_as_glb_and_come_in_again(desk: Desk, tmp_path) -> None:
    desk.ask("export")
    assert desk.asking == "export" and desk.browser is not None
    desk.chosen(tmp_path / "out.glb")
    assert "Wrote 1 shape" in said(desk)
    before = desk.editor.project.shapes["limb"]
    desk.open(tmp_path / "out.glb")
    added = next(s for name, s in desk.editor.project.shapes.items() if name != "limb")
    assert (
        len(added.skeleton) >= len(before.skeleton) - 1 and added.mesh is not None and before.mesh is not None
    )
    tall = [float(np.ptp(shape.mesh.vertices[:, 1])) for shape in (before, added)]
    assert tall[0] == pytest.approx(tall[1], rel=1e-4)
    assert added.place[0] > 0.05, "beside what is there"


def test_an_export_of_nothing_says_what_to_do(desk: Desk, tmp_path) -> None:
    desk.cabinet.new()
    desk.asking = "export"
    with pytest.raises(InputError, match="Sketch"):
        desk.chosen(tmp_path / "out.glb")


def test_the_browser_lists_folders_and_what_can_be_opened(tmp_path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / ".hidden").mkdir()
    for name in ("b.glb", "A.GLB", "c.txt"):
        (tmp_path / name).write_text("")
    browser = Browser(tmp_path, (".glb",))
    assert [path.name for path in browser.folders()] == ["inner"]
    assert [path.name for path in browser.files()] == ["A.GLB", "b.glb"]
    browser.name = "b.glb"
    assert browser.chosen() == tmp_path / "b.glb"
    browser.name = "nothing.glb"
    with pytest.raises(InputError, match="no such file"):
        browser.chosen()
    browser.enter(tmp_path / "inner")
    assert browser.name == "" and browser.files() == []
    browser.enter(tmp_path / "gone")
    assert browser.files() == [] and "cannot be read" in browser.problem


def test_a_saved_name_gets_its_ending(tmp_path) -> None:
    browser = Browser(tmp_path, (".enliven",), "squid v1.2", saving=True)
    assert browser.chosen() == tmp_path / "squid v1.2.enliven"
    browser.name = "  "
    with pytest.raises(InputError, match="no file"):
        browser.chosen()


def test_a_shape_is_renamed_in_its_place(make_limb) -> None:
    project = Editor().project.with_shapes(make_limb("a", 2), make_limb("b", 2))
    made = renamed(project, "a", "mantle")
    assert list(made.shapes) == ["mantle", "b"] and made.shapes["mantle"].id == "mantle"
    with pytest.raises(InputError, match="already"):
        renamed(project, "a", "b")


def test_a_fault_of_our_own_is_told_and_changes_nothing(desk: Desk, monkeypatch) -> None:
    monkeypatch.delenv("ENLIVEN_DEBUG", raising=False)
    before = desk.editor.project
    assert not desk.editor.edit("break", lambda project: [project][1])
    assert desk.editor.project is before and "fault of enliven" in said(desk) and "IndexError" in said(desk)
    monkeypatch.setenv("ENLIVEN_DEBUG", "1")
    with pytest.raises(IndexError):
        desk.editor.edit("break", lambda project: [project][1])


def test_a_file_is_replaced_only_when_it_is_said_twice(tmp_path) -> None:
    (tmp_path / "old.enliven").write_text("precious")
    browser = Browser(tmp_path, (".enliven",), "old", saving=True)
    with pytest.raises(InputError, match="Save again"):
        browser.chosen()
    assert browser.chosen() == tmp_path / "old.enliven"
    own = Browser(tmp_path, (".enliven",), "old", saving=True, own=tmp_path / "old.enliven")
    assert own.chosen() == tmp_path / "old.enliven"


def test_a_save_that_fails_does_not_quit_later(desk: Desk, tmp_path) -> None:
    (tmp_path / "file").write_text("in the way")
    desk.ask("quit")
    desk.go_on(discard=False)
    with pytest.raises(ResourceError):
        desk.chosen(tmp_path / "file" / "work.enliven")
    desk.ask("save")
    desk.chosen(tmp_path / "work.enliven")
    assert not desk.over and not desk.cabinet.dirty
