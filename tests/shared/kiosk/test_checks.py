"""Tests that all mistakes in a kiosk's profile are reported together before anything starts."""

from __future__ import annotations

import fcntl
import socket
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from certificates import CertificateFolder

from enliven.kiosk import checks
from enliven.kiosk.checks import find_mistakes
from enliven.kiosk.mounts import Mount, find_mount
from enliven.kiosk.profile import SouvenirSettings, load_profile
from enliven.kiosk.screen_lock import is_screen_taken
from enliven.kiosk.souvenir_address import find_souvenir_address
from enliven.space.space_file import Place, Space, save_space
from enliven.wire import free_ports


def write(folder: Path, text: str) -> Path:
    path = folder / "foyer.toml"
    path.write_text(text, encoding="utf-8")
    return path


def mistakes(folder: Path, text: str, *, starts_here: bool = False) -> list[str]:
    return [str(mistake) for mistake in find_mistakes(write(folder, text), starts_here=starts_here)]


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        yield listener.getsockname()[1]


def test_empty_profile_has_no_mistakes(tmp_path: Path) -> None:
    assert mistakes(tmp_path, "") == []


def test_all_mistakes_are_found_at_once(tmp_path: Path) -> None:
    (tmp_path / "edge.toml").write_text("noodles = 3\n")
    secret = tmp_path / "password"
    secret.write_text("secret")
    secret.chmod(0o644)
    lines = mistakes(
        tmp_path,
        '[edges.edge]\nsettings = "edge.toml"\n[edges.stairs]\nport = 5600\nsettings = "gone.toml"\n'
        '[characters."my horse"]\nmesh = "chair"\n'
        '[characters.squid]\nmesh = "squid.glb"\nparts = "tentacles"\n'
        '[story]\nlanguage = "xx"\nattract = ["visit.mcap"]\n'
        '[screen]\nsize = "big"\n[care]\nrestart_at = "4 am"\n[health]\npassword_file = "password"\n',
    )
    for words in (
        "unknown key noodles. Did you mean nodes?",
        "the settings file gone.toml in edges.stairs does not exist",
        "'my horse' is not a valid name for a character",
        "the mesh file squid.glb in characters.squid does not exist",
        "characters.squid.parts",
        "the language 'xx' in story.language",
        "the file visit.mcap in story.attract does not exist",
        "the size 'big' in screen.size",
        "'4 am' is not a time of day",
        "other users can read this secret file",
    ):
        assert any(words in line for line in lines), (words, lines)
    assert len(lines) == 10


def test_another_package_adds_a_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = tmp_path / "tall_visitors.py"
    module.write_text(
        "from enliven.errors import InputError\n"
        "def find_mistakes(profile, path):\n"
        "    yield InputError(f'{profile.name} has a low door', where=path.name, remedy='Raise the door.')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    added = EntryPoint("doors", "tall_visitors:find_mistakes", checks.ENTRY_POINTS)
    monkeypatch.setattr(checks, "entry_points", lambda group: [added] if group == added.group else [])
    assert mistakes(tmp_path, 'name = "hall"\n') == ["foyer.toml: hall has a low door. Raise the door."]


def test_unknown_keys_of_all_tables_are_found(tmp_path: Path) -> None:
    lines = mistakes(
        tmp_path, 'nam = "a"\n[story]\ndwel = 1.0\nlost = "soon"\n[edges.a]\nport = 0\n[edges.b]\nprot = 1\n'
    )
    assert len(lines) == 5
    assert any("Did you mean name?" in line for line in lines)
    assert any("Did you mean story.dwell?" in line for line in lines)
    assert any("edges.b.prot" in line for line in lines)


def test_file_that_is_no_toml_is_one_mistake(tmp_path: Path) -> None:
    lines = mistakes(tmp_path, "name = \n")
    assert len(lines) == 1 and "not valid TOML" in lines[0]


def test_profile_of_a_later_version_is_refused(tmp_path: Path) -> None:
    lines = mistakes(tmp_path, "version = 99\n")
    assert len(lines) == 1 and "version 99" in lines[0]


def test_missing_profile_is_named(tmp_path: Path) -> None:
    lines = [str(mistake) for mistake in find_mistakes(tmp_path / "nowhere.toml")]
    assert len(lines) == 1 and "nowhere.toml" in lines[0]


def test_taken_ports_are_named_with_their_key(tmp_path: Path, taken_port: int) -> None:
    text = f"[health]\nport = {taken_port}\n[edges.edge]\nport = {free_ports()[0]}\n"
    lines = mistakes(tmp_path, text, starts_here=True)
    assert len(lines) == 1
    assert f"port {taken_port}" in lines[0] and "health.port" in lines[0]


def test_health_page_on_the_port_of_an_edge_is_refused(tmp_path: Path) -> None:
    port = free_ports()[0]
    lines = mistakes(tmp_path, f"[health]\nport = {port}\n[edges.edge]\nport = {port}\n", starts_here=True)
    assert any("health.port and edges.edge.port use the same port" in line for line in lines)


def test_missing_folder_of_recordings_is_named(tmp_path: Path) -> None:
    lines = mistakes(tmp_path, '[care]\nrecordings = "visits"\n', starts_here=True)
    assert any("mkdir -p" in line for line in lines)


def test_screen_is_taken_while_a_window_holds_its_file(tmp_path: Path) -> None:
    assert not is_screen_taken(0, tmp_path)
    with (tmp_path / "screen-0.lock").open("w") as held:
        assert not is_screen_taken(0, tmp_path), "left by a window that was killed"
        fcntl.flock(held, fcntl.LOCK_EX)
        assert is_screen_taken(0, tmp_path)
        assert not is_screen_taken(1, tmp_path)
    assert not is_screen_taken(0, tmp_path)


TABLE = """overlay / overlay rw,lowerdir=/media/root-ro,upperdir=/media/root-rw 0 0
/dev/sda3 /var/lib/enliven/recordings ext4 rw,noatime 0 0
/dev/sda4 /mnt/two\\040words vfat ro 0 0
"""


@pytest.mark.parametrize(
    ("place", "mount", "is_volatile"),
    [
        ("/var/lib/enliven", Mount(Path("/"), "overlay", False), True),
        (
            "/var/lib/enliven/recordings/a",
            Mount(Path("/var/lib/enliven/recordings"), "ext4", False),
            False,
        ),
        ("/mnt/two words", Mount(Path("/mnt/two words"), "vfat", True), False),
    ],
)
def test_file_system_of_a_folder(tmp_path: Path, place: str, mount: Mount, is_volatile: bool) -> None:
    table = tmp_path / "mounts"
    table.write_text(TABLE)
    result = find_mount(Path(place), table)
    assert result == mount and result.is_volatile is is_volatile


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("", "phones cannot reach souvenir.host = 127.0.0.1"),
        ('host = "localhost"', "phones cannot reach souvenir.host = localhost"),
        ('host = "::1"', "phones cannot reach souvenir.host = ::1"),
        ('host = "0.0.0.0"\naddress = "http://127.0.0.1:5592/"', "phones cannot reach souvenir.address"),
        ('address = "kiosk.example"', "souvenir.address 'kiosk.example'"),
        ('address = "ftp://kiosk.example/"', "is not a valid start of an address"),
        ('address = "http://user:word@kiosk.example/"', "is not a valid start of an address"),
        ('address = "http://kiosk.example/?a=1"', "is not a valid start of an address"),
        ('address = "http://kiosk.example/#a"', "is not a valid start of an address"),
        ('address = "http://kiosk.example:port/"', "is not a valid start of an address"),
        ('address = "http://[::1/"', "is not a valid start of an address"),
        ('address = "http:///"', "is not a valid start of an address"),
        ('address = "http://kiosk example/"', "is not a valid start of an address"),
        ('address = "http://müseum.example/"', "is not a valid start of an address"),
        (f'address = "http://{"a" * 100}.example/"', "is not a valid start of an address"),
        ("keep = 0", "souvenir.keep"),
        ("space = 1e9", "souvenir.space"),
        ('length = "long"', "souvenir.length"),
        ("port = 70000", "souvenir.port"),
        ("keeep = 3", "Did you mean souvenir.keep?"),
    ],
)
def test_souvenirs_that_no_phone_can_fetch_are_refused(tmp_path: Path, table: str, words: str) -> None:
    (line,) = mistakes(tmp_path, f'[souvenir]\nkind = "photo"\n{table}\n')
    assert words in line and "foyer.toml" in line


def test_certificate_of_souvenirs_is_checked(tmp_path: Path) -> None:
    _, key = CertificateFolder(tmp_path).make("kiosk")
    both = 'certificate = "kiosk.pem"\ncertificate_key = "kiosk.key"\n'
    start = '[souvenir]\nkind = "photo"\nhost = "0.0.0.0"\n'
    assert mistakes(tmp_path, start + both) == []
    assert find_souvenir_address(load_profile(tmp_path / "foyer.toml").souvenir).startswith("https://")
    (line,) = mistakes(tmp_path, start + 'certificate = "kiosk.pem"\n')
    assert "only one of" in line
    (line,) = mistakes(tmp_path, start + both + 'address = "http://kiosk.example/"\n')
    assert "the server uses TLS" in line and "https://" in line
    key.chmod(0o644)
    (line,) = mistakes(tmp_path, start + both)
    assert "other users can read this secret file" in line and "kiosk.key" in line
    key.unlink()
    (line,) = mistakes(tmp_path, start + both)
    assert "souvenir.certificate_key does not exist" in line


def test_an_unknown_kind_of_souvenir_is_refused(tmp_path: Path) -> None:
    (line,) = mistakes(tmp_path, '[souvenir]\nkind = "video"\n')
    assert "souvenir.kind" in line and "film" in line


@pytest.mark.parametrize(
    "table",
    [
        'kind = "photo"\nhost = "0.0.0.0"',
        'kind = "film"\nhost = "192.168.1.20"',
        'kind = "photo"\naddress = "https://kiosk.example/souvenirs"',
        'kind = ""\nhost = "127.0.0.1"',
    ],
)
def test_souvenirs_that_phones_can_fetch_are_accepted(tmp_path: Path, table: str) -> None:
    assert mistakes(tmp_path, f"[souvenir]\n{table}\n") == []


def test_the_port_of_souvenirs_must_be_free(tmp_path: Path, taken_port: int) -> None:
    table = f'[souvenir]\nkind = "photo"\nhost = "0.0.0.0"\nport = {taken_port}\n'
    (line,) = [line for line in mistakes(tmp_path, table, starts_here=True) if "souvenir.port" in line]
    assert "another program already uses the port" in line
    same = table + f"[health]\nport = {taken_port}\n"
    assert any("use the same port" in line for line in mistakes(tmp_path, same, starts_here=True))


def test_the_address_of_souvenirs_is_that_of_the_network() -> None:
    given = SouvenirSettings("photo", address="https://kiosk.example/souvenirs")
    assert find_souvenir_address(given) == "https://kiosk.example/souvenirs/"
    assert find_souvenir_address(SouvenirSettings("photo", host="10.0.0.2", port=80)) == "http://10.0.0.2:80/"
    assert find_souvenir_address(SouvenirSettings("photo", host="127.0.0.1")) == ""


def test_edges_need_places_in_the_space(tmp_path: Path) -> None:
    save_space(tmp_path / "space.toml", Space({"left": Place(), "hall": Place()}), [])
    edges = '[edges.left]\n[edges.right]\nport = 5600\n[edges.hall]\naddress = "10.0.0.5"\n'
    (line,) = mistakes(tmp_path, f'{edges}[zone]\nspace = "space.toml"\n')
    assert "no position for edges.right" in line and "left, hall" in line
    assert mistakes(tmp_path, f'{edges.replace("right", "hall2")}[zone]\nspace = "space.toml"\n')
    kept = edges.replace("[edges.right]\nport = 5600\n", "")
    assert mistakes(tmp_path, f'{kept}[zone]\nspace = "space.toml"\n') == []


def test_a_space_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    (line,) = mistakes(tmp_path, '[zone]\nspace = "gone.toml"\n')
    assert "the file gone.toml in zone.space does not exist" in line
    (tmp_path / "space.toml").write_text("sensors = 3\n")
    (line,) = mistakes(tmp_path, '[zone]\nspace = "space.toml"\n')
    assert "contains no sensors" in line and "space.toml" in line
