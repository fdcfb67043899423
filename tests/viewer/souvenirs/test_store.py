"""Tests of the files of souvenirs: secret names, expiry, and the limit on their size."""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.errors import ResourceError
from enliven.kiosk.profile import MAX_SOUVENIR_AGE_S
from enliven_viewer.souvenirs.store import MAX_PART_AGE_S, SouvenirStore

KEEP_S = 600.0
MAX_BYTES = 1000


class Clock:
    """A clock that a test sets."""

    def __init__(self, now: float = 1_800_000_000.0) -> None:
        self.now = now

    def __call__(self) -> float:
        return self.now


def make_store(folder: Path, clock: Clock, max_bytes: int = MAX_BYTES) -> SouvenirStore:
    return SouvenirStore(folder / "souvenirs", KEEP_S, max_bytes, 0, clock)


def add(store: SouvenirStore, size: int = 10, kind: str = "photo") -> str:
    """Stores a souvenir of some bytes. Returns its token."""
    token, path = store.reserve(kind)
    path.write_bytes(b"x" * size)
    return token


def test_a_souvenir_is_found_by_its_token_only(tmp_path):
    store = make_store(tmp_path, Clock())
    first, second = add(store, 1), add(store, 2, "film")
    assert store.find(first).stat().st_size == 1 and store.find(second).suffix == ".mp4"
    name = store.find(first).name
    for wrong in ("", first[:-1], first + "A", name, name[:-4], "../souvenirs/" + name, "*", "é" * 22):
        assert store.find(wrong) is None


def test_only_this_user_can_list_the_folder(tmp_path):
    add(make_store(tmp_path, Clock()))
    assert stat.S_IMODE((tmp_path / "souvenirs").stat().st_mode) == 0o700


def test_a_souvenir_is_gone_after_its_time(tmp_path):
    clock = Clock()
    store = make_store(tmp_path, clock)
    token = add(store)
    clock.now += KEEP_S - 1.0
    assert store.delete_expired() == 1 and store.find(token) is not None
    clock.now += 2.0
    assert store.find(token) is None, "it is refused even before its file is deleted"
    assert store.delete_expired() == 0 and not list((tmp_path / "souvenirs").iterdir())


def test_a_store_with_other_settings_deletes_old_souvenirs(tmp_path):
    clock = Clock()
    add(make_store(tmp_path, clock))
    clock.now += KEEP_S + 1.0
    SouvenirStore(tmp_path / "souvenirs", 1e4, 10**9, 0, clock).delete_expired()
    assert not list((tmp_path / "souvenirs").iterdir())


def test_a_clock_that_was_set_back_prolongs_no_souvenir(tmp_path):
    clock = Clock()
    store = make_store(tmp_path, clock)
    token = add(store)
    clock.now -= MAX_SOUVENIR_AGE_S
    assert store.find(token) is None and store.delete_expired() == 0


@given(sizes=st.lists(st.integers(0, 400), max_size=20))
def test_the_newest_souvenirs_fit_the_limit(sizes):
    clock = Clock()
    with tempfile.TemporaryDirectory() as folder:
        store = make_store(Path(folder), clock)
        tokens = []
        for size in sizes:
            clock.now += 1.0
            tokens.append(add(store, size))
        count = store.delete_expired()
        kept = [store.find(token) is not None for token in tokens]
        assert kept == sorted(kept), "a newer one is never deleted before an older one"
        assert sum(kept) == count
        assert sum(size for size, is_kept in zip(sizes, kept, strict=True) if is_kept) <= MAX_BYTES
        if count < len(sizes):
            assert sum(sizes[-count - 1 :]) > MAX_BYTES, "none is deleted without need"


def test_other_files_stay_and_links_are_not_served(tmp_path):
    clock = Clock()
    store = make_store(tmp_path, clock)
    token, path = store.reserve("photo")
    secret = tmp_path / "secret"
    secret.write_text("secret")
    path.symlink_to(secret)
    other = path.with_name("notes.txt")
    other.write_text("mine")
    clock.now += KEEP_S + 1.0
    assert store.find(token) is None and store.delete_expired() == 0
    assert other.exists() and secret.exists()


def test_remains_of_a_killed_program_are_deleted(tmp_path):
    clock = Clock()
    store = make_store(tmp_path, clock)
    _, path = store.reserve("film")
    old, new = (path.with_name(f".{path.name}.{k}.part") for k in range(2))
    for part, age_s in ((old, MAX_PART_AGE_S + 1.0), (new, 1.0)):
        part.write_bytes(b"x")
        os.utime(part, (clock.now - age_s, clock.now - age_s))
    store.delete_expired()
    assert not old.exists() and new.exists()


def test_a_full_disk_is_refused(tmp_path):
    store = SouvenirStore(tmp_path, KEEP_S, MAX_BYTES, 1 << 60)
    with pytest.raises(ResourceError, match="too little free space for souvenirs"):
        store.reserve("photo")


def test_a_folder_that_cannot_be_made_is_reported(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ResourceError, match="souvenirs cannot be stored"):
        SouvenirStore(tmp_path / "file" / "souvenirs", KEEP_S, MAX_BYTES).reserve("photo")
