"""Tests of key files: private permissions, never replaced by accident, and refused if invalid."""

from __future__ import annotations

import os
import stat
import threading
from pathlib import Path

import pytest
import zmq
from zmq.utils import z85

from enliven import cli
from enliven.errors import InputError
from enliven.keys.client import ClientKeys, find_client_keys
from enliven.keys.key_files import (
    KeyPair,
    KeyStore,
    PairedEdge,
    PairedViewer,
    clean_name,
    fingerprint,
)

posix = pytest.mark.skipif(os.name != "posix", reason="there are no such permissions here")


@pytest.fixture
def store(tmp_path: Path) -> KeyStore:
    return KeyStore(tmp_path / "enliven" / "keys")


def viewer(number: int, name: str = "laptop") -> PairedViewer:
    return PairedViewer(bytes([number]) * 32, name, "perform", "2026-11-29")


def test_made_keys_are_read_again_and_belong_together(store: KeyStore) -> None:
    assert store.load_own_pair() is None
    pair = store.create_own_pair()
    assert store.load_own_pair() == pair and len(pair.public) == len(pair.secret) == 32
    assert "secret" not in repr(pair), "a log must not show it"


@posix
@pytest.mark.parametrize("mask", [0o000, 0o022, 0o077])
def test_all_files_are_for_their_owner_only(store: KeyStore, mask: int) -> None:
    before = os.umask(mask)
    try:
        store.create_own_pair()
        store.add_viewer(viewer(1))
        store.add_edge(PairedEdge(bytes(32), "stage", "10.0.0.5", 5581, "watch"))
    finally:
        os.umask(before)
    files = [path for path in store.folder.rglob("*") if path.is_file()]
    assert len(files) == 3 and {stat.S_IMODE(path.stat().st_mode) for path in files} == {0o600}
    assert not stat.S_IMODE(store.folder.stat().st_mode) & 0o077


def test_keys_are_replaced_only_on_request(store: KeyStore) -> None:
    first = store.create_own_pair()
    with pytest.raises(InputError, match=r"already has keys.*--overwrite"):
        store.create_own_pair()
    assert store.load_own_pair() == first
    assert store.create_own_pair(overwrite=True) != first
    assert [path.name for path in store.folder.iterdir()] == ["own.toml"], "no temporary file is left"


def test_of_many_makers_at_once_one_succeeds(store: KeyStore) -> None:
    pairs: list[KeyPair] = []
    refused: list[InputError] = []

    def make() -> None:
        try:
            pairs.append(store.create_own_pair())
        except InputError as error:
            refused.append(error)

    threads = [threading.Thread(target=make) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(pairs) == 1 and len(refused) == 7 and store.load_own_pair() == pairs[0]


@posix
@pytest.mark.parametrize("mode", [0o604, 0o640, 0o660, 0o602, 0o644])
def test_keys_that_others_may_read_are_refused_with_the_remedy(store: KeyStore, mode: int) -> None:
    store.create_own_pair()
    store.own_path.chmod(mode)
    with pytest.raises(InputError, match=rf"other users.*mode {mode:04o}.*chmod 600 .*--overwrite"):
        store.load_own_pair()


@posix
def test_a_link_and_a_folder_are_not_key_files(store: KeyStore, tmp_path: Path) -> None:
    store.create_own_pair()
    store.own_path.rename(tmp_path / "elsewhere.toml")
    store.own_path.symlink_to(tmp_path / "elsewhere.toml")
    with pytest.raises(InputError, match="not a regular file"):
        store.load_own_pair()
    store.own_path.unlink()
    store.own_path.mkdir()
    with pytest.raises(InputError, match="not a regular file"):
        store.load_own_pair()


# The keys are fixed, since test names contain them, and all test processes must collect the same names.
KEY = zmq.curve_public(z85.encode(bytes(range(32)))).decode()
OTHER = z85.encode(bytes(range(32, 64))).decode()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "public key is missing"),
        ("\x00\x01", "not valid TOML"),
        ("-----BEGIN OPENSSH PRIVATE KEY-----", "not valid TOML"),
        ("version = 99", "version 99"),
        (f'public = "{KEY[:-1]}"\nsecret = "{OTHER}"', "public key is missing or invalid"),
        (f'public = "{KEY}"\nsecret = 7', "secret key is missing or invalid"),
        (f'public = "{KEY}"\nsecret = "{"ä" * 40}"', "secret key"),
        (f'public = "{"#" * 40}"\nsecret = "{OTHER}"', "public key"),
        (f'public = "{KEY}"\nsecret = "{OTHER}"', "does not belong to the public key"),
    ],
)
def test_damaged_and_foreign_files_are_refused_in_a_sentence(store: KeyStore, text: str, told: str) -> None:
    store.create_own_pair()
    store.own_path.write_bytes(text.encode())
    with pytest.raises(InputError, match=told):
        store.load_own_pair()


def test_peers_are_stored_listed_and_forgotten(store: KeyStore) -> None:
    first, second = viewer(1), viewer(2, 'a "quoted" \\ name')
    edge = PairedEdge(bytes(32), "stage", "Kiosk.local", 5581, "watch", "2026-11-29")
    stamp = store.read_change_counter()
    store.add_viewer(first)
    store.add_viewer(second)
    store.add_edge(edge)
    assert store.load_viewers() == {first.public: first, second.public: second} and store.load_edges() == [
        edge
    ]
    assert store.read_change_counter() != stamp
    assert store.find_edge("kiosk.LOCAL", 5581) == edge and store.find_edge("kiosk.local", 5591) is None
    with pytest.raises(InputError, match="no paired viewer or edge matches"):
        store.forget("nobody")
    store.add_viewer(viewer(3, first.name))
    with pytest.raises(InputError, match="several paired viewers or edges match"):
        store.forget(first.name)
    assert store.forget(fingerprint(first.public)[:9]) == [first]
    assert store.forget("Kiosk.local") == [edge] and store.load_edges() == []
    assert set(store.load_viewers()) == {second.public, bytes([3]) * 32}


def test_an_edge_that_is_paired_again_replaces_the_one_at_its_address(store: KeyStore) -> None:
    store.add_edge(PairedEdge(bytes(32), "old", "10.0.0.5", 5581, "watch"))
    store.add_edge(PairedEdge(bytes([1]) * 32, "new", "10.0.0.5", 5581, "watch"))
    assert [edge.name for edge in store.load_edges()] == ["new"]


def test_a_damaged_peer_does_not_hide_the_others(store: KeyStore) -> None:
    store.add_viewer(viewer(1))
    damaged = store.folder / "viewers" / "damaged.toml"
    damaged.write_text(f'version = 1\npublic = "{KEY}"\nname = "x"\nrole = "king"\n')
    damaged.chmod(0o600)
    problems: list[str] = []
    assert list(store.load_viewers(problems)) == [viewer(1).public]
    assert len(problems) == 1 and "role is 'king'" in problems[0] and "rm " in problems[0]
    with pytest.raises(InputError, match="king"):
        store.load_viewers()


def test_viewers_use_the_key_of_the_paired_edge_and_else_their_own_on_this_machine(store: KeyStore) -> None:
    assert find_client_keys("127.0.0.1", 5581, store.folder) is None
    own = store.create_own_pair()
    assert find_client_keys("127.0.0.1", 5581, store.folder) == ClientKeys(own.public, own)
    assert find_client_keys("localhost", 5581, store.folder) == ClientKeys(own.public, own)
    assert find_client_keys("10.0.0.5", 5581, store.folder) is None
    store.add_edge(PairedEdge(bytes([7]) * 32, "stage", "10.0.0.5", 5581, "watch"))
    assert find_client_keys("10.0.0.5", 5581, store.folder) == ClientKeys(bytes([7]) * 32, own)
    store.own_path.unlink()
    with pytest.raises(InputError, match=r"keys of this computer are missing.*enliven pair"):
        find_client_keys("10.0.0.5", 5581, store.folder)


def test_names_of_peers_stay_short_printable_lines(store: KeyStore) -> None:
    assert clean_name("a\x1b[2J  b ") == "a[2J b"
    assert clean_name("\x00") == "?" and len(clean_name("x" * 100)) == 64
    store.add_viewer(PairedViewer(bytes([7]) * 32, 'a\nb"', "watch"))
    assert [viewer.name for viewer in store.load_viewers().values()] == ['a?b"']


@pytest.fixture
def own_config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> KeyStore:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    return KeyStore()


def test_the_command_makes_lists_shows_and_forgets(
    own_config: KeyStore, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["keys", "show"]) == 3 and "keys make" in capsys.readouterr().err
    assert cli.run(["keys", "make"]) == 0
    own = own_config.load_own_pair()
    assert own is not None
    print_of_own = fingerprint(own.public)
    assert print_of_own in capsys.readouterr().out
    assert cli.run(["keys", "make"]) == 3 and "--overwrite" in capsys.readouterr().err
    own_config.add_viewer(viewer(1, "laptop"))
    own_config.add_edge(PairedEdge(bytes(32), "stage", "10.0.0.5", 5581, "watch"))
    assert cli.run(["keys", "list"]) == 0
    listed = capsys.readouterr().out
    assert print_of_own in listed and "laptop" in listed and "stage at 10.0.0.5:5581" in listed
    assert own.secret.hex() not in listed
    assert cli.run(["keys", "forget", "laptop"]) == 0 and "removed: laptop" in capsys.readouterr().out
    assert cli.run(["keys", "show"]) == 0 and capsys.readouterr().out.strip() == print_of_own
    assert cli.run(["keys", "make", "--overwrite"]) == 0
    own_config.own_path.write_text("nonsense")
    capsys.readouterr()
    assert cli.run(["keys", "list"]) == 3
    output = capsys.readouterr()
    assert "damaged" in output.out and "not valid TOML" in output.err and "stage" in output.out


def test_one_key_at_two_addresses_stays_paired_with_both(tmp_path: Path) -> None:
    """An edge and a relay on one computer have the same key."""
    store, public = KeyStore(tmp_path), bytes(range(32))
    store.add_edge(PairedEdge(public, "edge", "10.0.0.5", 5581, "perform"))
    store.add_edge(PairedEdge(public, "relay", "10.0.0.5", 5591, "watch"))
    assert {edge.control_port for edge in store.load_edges()} == {5581, 5591}
    store.add_edge(PairedEdge(bytes(32), "other", "10.0.0.5", 5591, "watch"))
    assert store.server_key("10.0.0.5", 5591) == bytes(32), "another key at an address replaces the old one"
    assert store.server_key("10.0.0.5", 5581) == public
    store.forget("edge")
    assert [edge.name for edge in store.load_edges()] == ["other"]
