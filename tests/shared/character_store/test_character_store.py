"""Tests of the store of prepared characters: it returns the same bits, and never the result of other
inputs.
"""

from __future__ import annotations

import contextlib
import os
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from enliven.character_store import store
from enliven.character_store.prepared import PreparedCharacter, prepare_once
from enliven.character_store.store import CharacterStore, compute_cache_key
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.errors import InputError
from enliven.files import ReferencedFiles
from enliven.possession import ActorSettings, prepare_for_actor
from enliven.samples.shipped import load_sample


@pytest.fixture(scope="module")
def prepared() -> PreparedCharacter:
    """Returns the chair, prepared for possession."""
    mesh, settings, size, height = prepare_for_actor(load_sample("chair"), ActorSettings(), fit=False)
    character = character_from_graph(mesh, DeformationGraph.build(mesh, nodes=32), "chair")
    return PreparedCharacter(character, settings, size, height, None, ("a note",))


class Counter:
    """Prepares a character and counts the calls."""

    def __init__(self, result: PreparedCharacter) -> None:
        self.result, self.count = result, 0

    def __call__(self) -> PreparedCharacter:
        self.count += 1
        return self.result


def packed(prepared: PreparedCharacter) -> bytes:
    """Returns all bytes of a prepared character."""
    return PreparedCharacter.unpack(prepared.pack()).pack()


def test_second_start_reads_the_same_bits(prepared: PreparedCharacter, tmp_path: Path) -> None:
    prepare = Counter(prepared)
    first = prepare_once("key", prepare, store=CharacterStore(tmp_path / "new"))
    second = prepare_once("key", prepare, store=CharacterStore(tmp_path / "new"))
    assert prepare.count == 1
    assert packed(first) == packed(second) == packed(prepared)
    assert second.notes == ("a note",)
    for name in ("vertices", "faces", "pivots", "edges"):
        before, after = (getattr(each.character, name) for each in (prepared, second))
        assert before.dtype == after.dtype and np.array_equal(before, after)
    assert os.stat(tmp_path / "new").st_mode & 0o077 == 0


@pytest.mark.parametrize("damage", ["flipped bit", "cut off", "empty", "another object", "no character"])
def test_damaged_file_is_ignored_and_written_again(
    prepared: PreparedCharacter, tmp_path: Path, damage: str
) -> None:
    prepare, folder = Counter(prepared), CharacterStore(tmp_path)
    prepare_once("key", prepare, store=folder)
    (path,) = tmp_path.iterdir()
    good = path.read_bytes()
    if damage == "flipped bit":
        middle = len(good) // 2
        path.write_bytes(good[:middle] + bytes([good[middle] ^ 16]) + good[middle + 1 :])
    elif damage == "cut off":
        path.write_bytes(good[:-10])
    elif damage == "empty":
        path.write_bytes(b"")
    else:
        folder.save("key", pickle.dumps((1, 2) if damage == "no character" else Path("/")))
    prepare_once("key", prepare, store=folder)
    assert prepare.count == 2
    assert prepare_once("key", prepare, store=folder) is not None
    assert prepare.count == 2 and path.read_bytes() == good


def test_file_cannot_run_code(tmp_path: Path) -> None:
    class Harm:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.mkdir, (str(tmp_path / "harm"),)

    with pytest.raises(ValueError, match=r"mkdir is not allowed"):
        PreparedCharacter.unpack(pickle.dumps((Harm(),)))
    assert not (tmp_path / "harm").exists()


def test_key_depends_on_inputs_and_code(monkeypatch) -> None:
    settings = ActorSettings()
    key = compute_cache_key("mesh", "digest", 128, settings)
    assert key == compute_cache_key("mesh", "digest", 128, ActorSettings())
    assert key != compute_cache_key("mesh", "digest", 129, settings)
    assert key != compute_cache_key("mesh", "digest", 128, replace(settings, height_ratio=1.25))
    assert key != compute_cache_key(
        "mesh", "digest", 128, replace(settings, embedded=replace(settings.embedded)), "up"
    )
    monkeypatch.setattr(store, "_code_version", lambda: ("other",))
    assert key != compute_cache_key("mesh", "digest", 128, settings)


def test_changed_texture_is_noticed(prepared: PreparedCharacter, tmp_path: Path) -> None:
    folder = CharacterStore(tmp_path / "store")
    counts = []

    def prepare_in(place: Path) -> None:
        def prepare() -> PreparedCharacter:
            counts.append(place)
            files = ReferencedFiles(place / "horse.obj")
            for name in ("fur.png", "eyes.png"):
                with contextlib.suppress(InputError):
                    files.read_named_file(name)
            return prepared

        prepare_once("key", prepare, place, folder)

    mesh, other = tmp_path / "mesh", tmp_path / "other"
    mesh.mkdir()
    other.mkdir()
    (mesh / "fur.png").write_bytes(b"brown")
    prepare_in(mesh)
    prepare_in(mesh)
    assert len(counts) == 1
    (mesh / "fur.png").write_bytes(b"white")
    prepare_in(mesh)
    assert len(counts) == 2, "a texture has changed"
    (mesh / "eyes.png").write_bytes(b"blue")
    prepare_in(mesh)
    assert len(counts) == 3, "a missing texture exists now"
    (other / "fur.png").write_bytes(b"black")
    prepare_in(other)
    assert len(counts) == 4, "the same mesh has other textures in another folder"
    prepare_in(other)
    assert len(counts) == 4


def test_folder_is_bounded_and_keeps_the_newest(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(store, "MAX_FOLDER_BYTES", 3500)
    folder = CharacterStore(tmp_path)
    noise = np.random.default_rng(7)
    for number in range(5):
        folder.save(f"{number}", noise.bytes(1000))
        for path in tmp_path.iterdir():
            os.utime(path, (path.stat().st_mtime - 10, path.stat().st_mtime - 10))
        if number:
            assert folder.load("1") is not None  # Repeated use makes it the newest.
    assert sorted(path.stem for path in tmp_path.iterdir()) == ["1", "3", "4"]
    assert folder.load("0") is None


def test_unwritable_or_missing_folder_prepares_each_time(prepared: PreparedCharacter, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for folder in (CharacterStore(None), CharacterStore(tmp_path / "file" / "store")):
        prepare = Counter(prepared)
        first = prepare_once("key", prepare, store=folder)
        second = prepare_once("key", prepare, store=folder)
        assert prepare.count == 2 and packed(first) == packed(second)


def test_too_large_character_is_not_stored(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(store, "MAX_FILE_BYTES", 1000)
    folder = CharacterStore(tmp_path)
    folder.save("large", bytes(1001))
    folder.save("small", bytes(1000))
    assert [path.stem for path in tmp_path.iterdir()] == ["small"]
    # A file that unpacks to more than the allowed size is not read.
    monkeypatch.setattr(store, "MAX_FILE_BYTES", 999)
    assert folder.load("small") is None
