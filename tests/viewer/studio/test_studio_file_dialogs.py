"""Tests of the file dialog: locations, recent folders, sorting, new folders, and files that are not
projects.
"""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path

import pytest
from PIL import Image

from enliven.errors import InputError
from enliven_viewer.studio.app.file_browser import FileBrowser, list_places
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.workspace.workspace import Workspace


def test_places_are_the_users_own_and_recent_folders_each_once(tmp_path: Path, monkeypatch) -> None:
    home, work, card = tmp_path / "home", tmp_path / "work", tmp_path / "card"
    for folder in (home / "Downloads", work, card):
        folder.mkdir(parents=True)
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("USERPROFILE", str(home))
    recent = [
        str(card / "a.enliven"),
        str(card / "b.glb"),
        str(tmp_path / "gone" / "c.glb"),
        str(home / "d.glb"),
    ]
    listed = list_places(recent, work)
    folders = [folder for _, folder in listed]
    assert folders[0] == home and home / "Downloads" in folders and work in folders
    assert folders.count(card) == 1 and folders.count(home) == 1
    assert tmp_path / "gone" not in folders and ("Home", home) in listed
    assert Path(home.anchor) in folders


def test_files_are_sorted_by_name_time_or_size(tmp_path: Path) -> None:
    for number, (name, size) in enumerate((("b.glb", 10), ("a.glb", 30), ("c.glb", 20))):
        path = tmp_path / name
        path.write_bytes(bytes(size))
        os.utime(path, (1e9 + number, 1e9 + number))
    browser, orders = FileBrowser(tmp_path, (".glb",)), {}
    for order in ("name", "newest", "largest"):
        browser.order = order
        orders[order] = "".join(path.stem for path in browser.files())
    assert orders == {"name": "abc", "newest": "cab", "largest": "acb"}


def test_a_new_folder_is_made_and_listed(tmp_path: Path) -> None:
    browser = FileBrowser(tmp_path, (".enliven",), "work", saving=True)
    browser.new_folder_name = " dances "
    browser.make_folder()
    assert browser.folder == (tmp_path / "dances").resolve() and browser.new_folder_name is None
    assert browser.name == "work" and browser.get_path() == browser.folder / "work.enliven"
    for name, words in (
        ("", "a folder cannot have this name"),
        ("..", "a folder cannot have this name"),
        ("a/b", "a folder cannot have this name"),
        ("x" * 300, "cannot be created"),
    ):
        browser.new_folder_name = name
        with pytest.raises(Exception, match=words):
            browser.make_folder()
    (browser.folder / "twice").mkdir()
    browser.new_folder_name = "twice"
    with pytest.raises(InputError, match="already"):
        browser.make_folder()


@pytest.mark.parametrize("name", ["x" * 300, "~nobody-of-that-name/a.glb", "a\0b"])
@pytest.mark.parametrize("saving", [False, True])
def test_a_name_that_no_file_can_have_is_refused(tmp_path: Path, name: str, saving: bool) -> None:
    browser = FileBrowser(tmp_path, (".glb",), saving=saving)
    browser.name = name
    with pytest.raises(InputError, match=r"a file cannot have this name|does not exist"):
        browser.get_path()


def picture() -> bytes:
    out = io.BytesIO()
    Image.new("RGB", (4, 4)).save(out, "PNG")
    return out.getvalue()


def archive(**entries: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as packed:
        for name, text in entries.items():
            packed.writestr(name.replace("__", "/"), text)
    return out.getvalue()


FOREIGN = {
    "a PNG picture": picture(),
    "an empty file": b"",
    "JSON text": b'{"scene": [1, 2,',
    "a glTF model": b"glTF\x02\0\0\0",
    "a web page or XML text": b"<!doctype html><p>moved",
    "text": b"hello, this is a note",
    "a ZIP archive with 2 files": archive(one="1", two="2"),
    "an empty ZIP archive": archive(),
    "a ZIP archive that is truncated": archive(one="1" * 500)[:80],
    "a ZIP archive with 1 file, such as project.json": archive(**{"project.json": '{"name": "other", }'}),
    "data of an unknown kind": bytes(range(256)) * 4,
    "a file of zeros": bytes(500),
}
"""Files with a project's name that are not projects, by their real type."""


@pytest.mark.parametrize("kind", FOREIGN)
def test_foreign_project_file_is_identified_in_plain_words(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "work.enliven"
    path.write_bytes(FOREIGN[kind])
    workspace = Workspace.new(Editor(), tmp_path / "own")
    before = workspace.editor.project
    assert not workspace.run_and_report(lambda: workspace.open(path))
    messages = " ".join(f"{toast.text} {toast.remedy}" for toast in workspace.editor.toasts.shown)
    assert kind in messages or "truncated or damaged" in messages, messages
    assert "ending in .enliven" not in messages
    for word in ("Error", "Expecting", "delimiter", "column", "BadZip", "char 0", "line 1"):
        assert word not in messages, messages
    if kind == "a glTF model":
        assert "ending in .glb" in messages
    assert workspace.editor.project is before
