"""Tests of the access rules for the web page."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from enliven.errors import InputError
from enliven_viewer.web.access import WebAccess, load_access, read_token


def test_other_machines_need_tls_or_the_users_consent() -> None:
    with pytest.raises(
        InputError, match=r"--host 0\.0\.0\.0: this address is open to other machines.*--insecure"
    ):
        load_access("0.0.0.0")
    assert load_access("0.0.0.0", insecure=True) == WebAccess("0.0.0.0")
    assert load_access("127.0.0.1").is_local and load_access("::1").is_local


def test_certificate_needs_its_key() -> None:
    with pytest.raises(InputError, match="needs a certificate and its key"):
        load_access("127.0.0.1", certificate=Path("only.pem"))


def test_files_that_are_no_certificate_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "noise.pem"
    path.write_text("not a certificate")
    with pytest.raises(InputError, match="does not contain a certificate"):
        load_access("0.0.0.0", certificate=path, key=path)


def test_token_stays_and_only_its_owner_can_read_it(tmp_path: Path) -> None:
    folder = tmp_path / "enliven"
    token = read_token(folder)
    assert len(token) >= 20 and read_token(folder) == token
    assert stat.S_IMODE((folder / "web-token").stat().st_mode) == 0o600
    (folder / "web-token").write_text("\0 damaged")
    assert len(read_token(folder)) >= 20 and read_token(folder) == read_token(folder)


@pytest.mark.parametrize(
    ("host", "origin", "admitted"),
    [
        ("127.0.0.1:5588", "http://127.0.0.1:5588", True),
        ("localhost:5588", "http://localhost:5588", True),
        ("[::1]:5588", "http://[::1]:5588", True),
        ("127.0.0.1:5588", "", True),
        ("127.0.0.1:5588", "http://other.example", False),
        ("other.example:5588", "http://other.example:5588", False),
        ("", "", False),
    ],
)
def test_foreign_sites_and_names_are_refused_on_this_machine(host: str, origin: str, admitted: bool) -> None:
    assert WebAccess("127.0.0.1").admits("", host, origin) is admitted


def test_network_page_needs_its_token() -> None:
    access = WebAccess("0.0.0.0", token="secret")
    assert access.admits("secret", "10.0.0.2:5588", "https://10.0.0.2:5588")
    assert not access.admits("", "10.0.0.2:5588", "https://10.0.0.2:5588")
    assert not access.admits("sécret", "10.0.0.2:5588", "https://10.0.0.2:5588")


def test_address_names_scheme_port_and_token() -> None:
    assert WebAccess("::1").link(5588) == "http://[::1]:5588/"
    access = WebAccess("10.0.0.2", "secret", Path("a.pem"), Path("b.pem"))
    assert access.link(5588) == "https://10.0.0.2:5588/#token=secret"
