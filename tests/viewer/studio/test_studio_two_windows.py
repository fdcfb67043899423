"""Tests that of two windows on one project, neither overwrites the other's work without asking."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from in_a_window import in_a_window

from enliven.document.project import Marker, are_identical
from enliven.errors import ResourceError
from enliven.formats.project.file import read_project
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.workspace.project_comparison import compare_projects, with_saved_items
from enliven_viewer.studio.workspace.workspace import Workspace

SESSION = Path(__file__).parents[1] / "studio_two_windows_session.py"


@pytest.fixture
def windows(make_limb, tmp_path: Path) -> tuple[Workspace, Workspace]:
    """Returns two windows that opened the same file."""
    first, second = (Workspace.new(Editor(), tmp_path / name) for name in ("one", "two"))
    first.editor.edit("add", lambda project: project.with_characters(make_limb("shared", 3)))
    first.store.save(tmp_path / "work.enliven")
    second.open(tmp_path / "work.enliven")
    for window, name in ((first, "first"), (second, "second")):
        window.editor.edit("add", lambda project, name=name: project.with_characters(make_limb(name, 4)))
    return first, second


def characters(path: Path) -> list[str]:
    return sorted(read_project(path).characters)


def test_the_last_save_asks_and_writes_nothing(windows, tmp_path: Path) -> None:
    first, second = windows
    first.save_or_ask()
    assert first.asking == "" and characters(tmp_path / "work.enliven") == ["first", "shared"]
    second.save_or_ask()
    assert second.asking == "changed" and second.store.dirty
    assert characters(tmp_path / "work.enliven") == ["first", "shared"]
    second.cancel()
    assert second.asking == "" and second.store.dirty
    second.save_or_ask()
    second.save(over=True)
    assert characters(tmp_path / "work.enliven") == ["second", "shared"] and not second.store.dirty
    first.editor.edit("rename", lambda project: project.drop_character("first"))
    first.save_or_ask()
    assert first.asking == "changed", "and so on, in turn"


@pytest.mark.parametrize("name", ["work.enliven", "link.enliven"])
def test_save_as_keeps_both(windows, tmp_path: Path, name: str) -> None:
    first, second = windows
    first.save_or_ask()
    second.save_or_ask()
    second.ask_for_name()
    assert second.asking == "save as"
    second.finish_file_dialog(tmp_path / "mine.enliven")
    assert characters(tmp_path / "mine.enliven") == ["second", "shared"]
    assert characters(tmp_path / "work.enliven") == ["first", "shared"]
    second.save_or_ask()
    assert second.asking == ""
    # Neither the changed file's own name nor a link to it avoids the question.
    first.store.path, other = tmp_path / "work.enliven", tmp_path / name
    if not other.exists():
        other.symlink_to(tmp_path / "work.enliven")
    (tmp_path / "work.enliven").write_bytes((tmp_path / "mine.enliven").read_bytes())
    first.editor.edit("rename", lambda project: project.drop_character("first"))
    first.asking = "save as"
    first.finish_file_dialog(other)
    assert first.asking == "changed" and characters(tmp_path / "work.enliven") == ["second", "shared"]


def test_both_are_compared_and_brought_together(windows, tmp_path: Path) -> None:
    first, second = windows
    first.editor.edit("mark", lambda p: type(p)(**{**vars(p), "markers": {"jump": Marker("jump", 1.0)}}))
    first.save_or_ask()
    second.save_or_ask()
    second.compare()
    assert {(difference.item, difference.side) for difference in second.compared} == {
        ("character first", "only in the file"),
        ("character second", "only here"),
        ("marker jump", "only in the file"),
    }
    second.add_saved_items()
    assert {difference.side for difference in second.compared} == {"only here"}
    second.save(over=True)
    assert characters(tmp_path / "work.enliven") == ["first", "second", "shared"]
    assert "jump" in read_project(tmp_path / "work.enliven").markers
    second.editor.undo()
    assert "first" not in second.editor.project.characters, "it is one edit"


def test_quit_waiting_for_the_save_continues_after_the_answer(windows) -> None:
    first, second = windows
    first.save_or_ask()
    second.quit()
    second.continue_waiting_command(discard=False)
    assert second.asking == "changed" and not second.ended
    second.save(over=True)
    assert second.ended
    first.quit()
    assert not first.store.dirty and first.ended, "nothing of this window is unsaved"


def test_an_answer_of_cancel_does_not_quit_later(windows) -> None:
    first, second = windows
    first.save_or_ask()
    second.quit()
    second.continue_waiting_command(discard=False)
    second.cancel()
    second.save(over=True)
    assert not second.ended


def test_unchanged_content_asks_no_question(windows, tmp_path: Path) -> None:
    """Only the content is compared, not the modification time."""
    second = windows[1]
    path = tmp_path / "work.enliven"
    os.utime(path, (1e9, 1e9))
    second.save_or_ask()
    assert second.asking == "" and not second.store.dirty
    path.write_bytes(path.read_bytes())
    second.editor.edit("rename", lambda project: project.drop_character("second"))
    path.unlink()
    second.save_or_ask()
    assert second.asking == "" and characters(path) == ["shared"]


def test_equal_edits_in_two_windows_ask_no_question(windows, tmp_path: Path) -> None:
    first, second = windows
    first.save_or_ask()
    assert second.run_and_report(lambda: second.open(tmp_path / "work.enliven"))
    second.continue_waiting_command(discard=True)
    assert are_identical(first.editor.project, second.editor.project)
    for window in windows:
        window.editor.edit("remove", lambda project: project.drop_character("shared"))
        window.save_or_ask()
        assert window.asking == "" and not window.store.dirty


def test_a_file_that_was_damaged_meanwhile_can_be_saved_over(windows, tmp_path: Path) -> None:
    second = windows[1]
    (tmp_path / "work.enliven").write_bytes(b"not a project")
    second.save_or_ask()
    assert second.asking == "changed"
    second.compare()
    assert second.compared is None and second.editor.toasts.shown[-1].is_error
    second.save(over=True)
    assert characters(tmp_path / "work.enliven") == ["second", "shared"]


def test_full_disk_is_reported_without_a_question(windows, monkeypatch) -> None:
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ResourceError, match="No space"):
        windows[1].save()
    assert windows[1].asking == "" and windows[1].store.dirty


def test_differences_of_every_part_are_found(make_limb) -> None:
    from enliven.document.project import CameraMark, Project

    a = Project(characters={"x": make_limb("x", 3)}, markers={"m": Marker("m", 1.0)})
    b = Project(
        characters={"x": make_limb("x", 4)},
        markers={"m": Marker("m", 1.0)},
        views={"v": CameraMark("v", (0.0, 0.0, 0.0), 0.0, 0.0, 1.0)},
    )
    differences = [(difference.item, difference.side) for difference in compare_projects(a, b)]
    assert differences == [("character x", "different"), ("view v", "only in the file")]
    assert compare_projects(a, a) == ()
    both = with_saved_items(a, b)
    assert both.characters["x"] is a.characters["x"] and "v" in both.views


@pytest.mark.slow
def test_the_dialogue_compares_adds_and_saves_in_the_real_window(tmp_path: Path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    assert report["done"], report
    assert report["asked"] == ["changed", "", "changed"]
    assert report["compared"] == ["character mine", "character theirs"]
    assert characters(tmp_path / "work.enliven") == ["mine", "theirs"]
