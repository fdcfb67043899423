"""Tests of the souvenir server with real sockets: it sends only files that are named by a token."""

from __future__ import annotations

import contextlib
import datetime
import http.client
import socket
import ssl
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from certificates import CertificateFolder
from patience import TIMEOUT_S

from enliven.errors import InputError, ResourceError
from enliven.kiosk.profile import KioskProfile, SouvenirSettings
from enliven.kiosk.souvenir_address import find_souvenir_address
from enliven.supervision.records import read_services
from enliven.wire import free_ports
from enliven_viewer.commands.kiosk_souvenirs import kiosk_souvenirs
from enliven_viewer.language import set_language
from enliven_viewer.souvenirs import server
from enliven_viewer.souvenirs.server import serve_souvenirs
from enliven_viewer.souvenirs.store import make_store


@pytest.fixture(autouse=True)
def own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Gives each test its own records and data."""
    monkeypatch.setenv("ENLIVEN_RUNTIME", str(tmp_path / "runtime"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def profile() -> KioskProfile:
    """Returns a kiosk profile that makes photos, on a free port."""
    return KioskProfile(
        name="foyer 1", souvenir=SouvenirSettings("photo", host="0.0.0.0", port=free_ports(1)[0])
    )


@contextlib.contextmanager
def serving(profile: KioskProfile) -> Iterator[None]:
    """Serves souvenirs until the block ends."""
    has_ended, failures = threading.Event(), []

    def serve() -> None:
        try:
            serve_souvenirs(profile, "profile", has_ended.is_set)
        except BaseException as error:
            failures.append(error)

    thread = threading.Thread(target=serve)
    thread.start()
    deadline = time.monotonic() + TIMEOUT_S
    try:
        while True:
            with contextlib.suppress(OSError):
                request(profile, "GET", "/")
                break
            assert thread.is_alive() and time.monotonic() < deadline, failures
            time.sleep(0.05)
        yield
    finally:
        has_ended.set()
        thread.join(TIMEOUT_S)
        assert not thread.is_alive()
    assert not failures


def request(
    profile: KioskProfile, method: str, path: str, headers: Mapping[str, str] | None = None
) -> tuple[int, dict[str, str], bytes]:
    """Returns status, headers and body of a response."""
    connection = connect(profile)
    with contextlib.closing(connection):
        connection.request(method, path, headers=dict(headers or {}))
        answer = connection.getresponse()
        return answer.status, {key.lower(): value for key, value in answer.getheaders()}, answer.read()


def connect(profile: KioskProfile) -> http.client.HTTPConnection:
    """Returns a phone's connection. It trusts the certificate of the kiosk if there is one."""
    settings = profile.souvenir
    if not settings.certificate:
        return http.client.HTTPConnection("127.0.0.1", settings.port, timeout=TIMEOUT_S)
    context = ssl.create_default_context(cafile=settings.certificate)
    return http.client.HTTPSConnection("localhost", settings.port, timeout=TIMEOUT_S, context=context)


def add(profile: KioskProfile, data: bytes, kind: str = "photo") -> tuple[str, Path]:
    """Stores a souvenir. Returns its token and its file."""
    token, path = make_store(profile).reserve(kind)
    path.write_bytes(data)
    return token, path


def test_a_phone_gets_the_photo_of_its_address(profile):
    token, _ = add(profile, b"picture")
    add(profile, b"another picture")
    with serving(profile):
        status, headers, body = request(profile, "GET", f"/{token}")
        assert (status, body) == (200, b"picture")
        assert headers["content-type"] == "image/jpeg" and headers["cache-control"] == "private, no-store"
        assert headers["content-disposition"] == 'inline; filename="foyer-1.jpg"'
        assert "default-src 'none'" in headers["content-security-policy"] and "server" not in headers
        status, headers, body = request(profile, "HEAD", f"/{token}")
        assert (status, body, headers["content-length"]) == (200, b"", "7")


def with_certificate(profile: KioskProfile, files: tuple[Path, Path]) -> KioskProfile:
    """Returns a profile with a certificate and its key."""
    certificate, key = map(str, files)
    return replace(profile, souvenir=replace(profile.souvenir, certificate=certificate, certificate_key=key))


def test_photo_is_encrypted_with_the_certificate_of_the_profile(profile, tmp_path):
    profile = with_certificate(profile, CertificateFolder(tmp_path).make("kiosk"))
    token, _ = add(profile, b"picture")
    with serving(profile):
        assert request(profile, "GET", f"/{token}")[::2] == (200, b"picture")
        with socket.create_connection(("127.0.0.1", profile.souvenir.port), TIMEOUT_S) as plain:
            plain.settimeout(TIMEOUT_S)
            plain.sendall(f"GET /{token} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            answer = b""
            with contextlib.suppress(ConnectionError):
                while part := plain.recv(1000):
                    answer += part
            assert b"picture" not in answer
    assert find_souvenir_address(profile.souvenir).startswith("https://")


def test_expired_certificate_and_wrong_key_are_refused(profile, tmp_path):
    folder = CertificateFolder(tmp_path)
    old = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
    with pytest.raises(InputError, match="expired on 2020-01-31"):
        serve_souvenirs(with_certificate(profile, folder.make("old", begin=old)), "foyer.toml")
    certificate, _ = folder.make("kiosk")
    _, other_key = folder.make("other")
    with pytest.raises(InputError, match="does not belong to the certificate"):
        serve_souvenirs(with_certificate(profile, (certificate, other_key)), "foyer.toml")


def test_command_finds_the_certificate_next_to_the_profile(tmp_path, monkeypatch):
    path = tmp_path / "foyer.toml"
    lines = ["[souvenir]", 'kind = "photo"', 'host = "0.0.0.0"']
    path.write_text("\n".join([*lines, 'certificate = "kiosk.pem"', 'certificate_key = "kiosk.key"']))
    served = []
    monkeypatch.setattr(server, "serve_souvenirs", lambda kiosk, *_: served.append(kiosk.souvenir))
    kiosk_souvenirs(path)
    (settings,) = served
    assert settings.certificate == str(tmp_path / "kiosk.pem")
    assert settings.certificate_key == str(tmp_path / "kiosk.key")


def test_a_phone_can_fetch_a_part_of_a_film(profile):
    token, _ = add(profile, bytes(range(100)), "film")
    with serving(profile):
        status, headers, body = request(profile, "GET", f"/{token}", {"Range": "bytes=10-19"})
        assert (status, body) == (206, bytes(range(10, 20)))
        assert headers["content-type"] == "video/mp4"


def test_other_paths_and_methods_are_refused(profile):
    token, path = add(profile, b"picture")
    with serving(profile):
        wrong = ["/", "/index.html", f"/{token[:-1]}", f"/{token}/", f"/{token}x", f"/{path.name}", "/.."]
        wrong += [f"/..%2Fsouvenirs%2F{path.name}", "/%2e%2e/%2e%2e/etc/passwd", f"/{token}%00", "/%ff" * 3]
        for address in wrong:
            status, _, body = request(profile, "GET", address)
            assert status in (404, 307) and b"picture" not in body, address
        for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS"):
            assert request(profile, method, f"/{token}")[0] == 405
    assert path.read_bytes() == b"picture"


def test_a_souvenir_whose_time_is_over_is_deleted_while_the_server_runs(profile):
    token, path = add(profile, b"picture")
    over = path.rename(path.with_name(f"{token}-{round(time.time()) - 1}.jpg"))
    with serving(profile):
        assert request(profile, "GET", f"/{token}")[0] == 404
        deadline = time.monotonic() + TIMEOUT_S
        while over.exists():
            assert time.monotonic() < deadline
            time.sleep(0.05)


def test_visitors_read_in_their_language_that_a_souvenir_is_gone(profile):
    set_language("de")
    try:
        with serving(profile):
            assert "gibt es nicht mehr" in request(profile, "GET", "/" + "a" * 22)[2].decode()
    finally:
        set_language("en")


def test_operators_see_the_server_on_the_health_page(profile):
    add(profile, b"picture")
    with serving(profile):
        deadline = time.monotonic() + TIMEOUT_S
        while not (records := read_services()):
            assert time.monotonic() < deadline
            time.sleep(0.05)
    assert [(record.name, record.status) for record in records] == [("souvenirs", "souvenirs kept: 1")]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (SouvenirSettings(), "this kiosk does not make souvenirs"),
        (SouvenirSettings("photo"), r"phones cannot reach souvenir\.host = 127\.0\.0\.1"),
    ],
)
def test_a_profile_without_souvenirs_is_refused(settings, words):
    with pytest.raises(InputError, match=words) as error:
        serve_souvenirs(KioskProfile(souvenir=settings), "foyer.toml")
    assert error.value.remedy and error.value.where == "foyer.toml"


def test_a_port_in_use_is_refused(profile):
    with serving(profile), pytest.raises(ResourceError, match=r"souvenir\.port"):
        serve_souvenirs(replace(profile), "foyer.toml")
