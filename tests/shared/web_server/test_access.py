"""Tests of passwords, rate limits, tokens, forms, and certificates."""

from __future__ import annotations

import base64
import datetime
from pathlib import Path

import pytest

from enliven.errors import InputError, ResourceError
from enliven.web_server import access
from enliven.web_server.access import (
    MAX_FAILURES,
    FormTokens,
    PasswordGate,
    is_same_origin,
    is_token,
    make_token,
    names_this_computer,
    read_password,
    tokens_match,
)
from enliven.web_server.certificate import load_certificate, read_end
from enliven.web_server.listening import bind_port, find_own_address, format_address

PASSWORD = "correct horse"
NOW = datetime.datetime(2026, 11, 29, tzinfo=datetime.UTC)


def basic(password: str, user: str = "operator") -> str:
    return f"Basic {base64.b64encode(f'{user}:{password}'.encode()).decode()}"


def password_file(folder: Path, text: str = f"{PASSWORD}\n", mode: int = 0o600) -> Path:
    path = folder / "password"
    path.write_text(text)
    path.chmod(mode)
    return path


def test_the_password_is_the_first_line(tmp_path):
    assert read_password(password_file(tmp_path, f"  {PASSWORD}  \nmore\n")) == PASSWORD


@pytest.mark.parametrize(
    ("text", "mode", "word"),
    [
        (PASSWORD, 0o640, "mode 0640"),
        (PASSWORD, 0o604, "mode 0604"),
        ("short\n", 0o600, "5 characters"),
        ("", 0o600, "0 characters"),
        ("x" * 5000, 0o600, "4096 bytes"),
    ],
)
def test_a_password_file_that_is_not_safe_is_refused(tmp_path, text, mode, word):
    with pytest.raises(InputError, match=word) as error:
        read_password(password_file(tmp_path, text, mode))
    assert error.value.remedy


def test_a_missing_password_file_and_a_folder_are_refused(tmp_path):
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(InputError):
            read_password(path)


def test_only_the_right_password_is_admitted():
    gate = PasswordGate(PASSWORD)
    assert gate.admits("192.0.2.1", basic(PASSWORD)) and gate.admits("192.0.2.1", basic(PASSWORD, "anyone"))
    for header in ("", basic("wrong"), "Basic ?", "Basic", f"Bearer {PASSWORD}", basic(PASSWORD)[:-6]):
        assert not PasswordGate(PASSWORD).admits("192.0.2.1", header)


def test_ten_wrong_passwords_lock_their_address_only(monkeypatch):
    clock = [1000.0]
    monkeypatch.setattr(access.time, "monotonic", lambda: clock[0])
    gate = PasswordGate(PASSWORD)
    for _ in range(10):
        gate.admits("192.0.2.1", basic("wrong password"))
    assert gate.compute_remaining_lockout_s("192.0.2.1") > 0.0 and not gate.admits(
        "192.0.2.1", basic(PASSWORD)
    )
    assert gate.admits("192.0.2.2", basic(PASSWORD))
    clock[0] += access.LOCKOUT_S
    assert not gate.admits("192.0.2.1", basic("wrong password"))
    assert gate.compute_remaining_lockout_s("192.0.2.1") > 0.0
    clock[0] += access.LOCKOUT_S
    assert gate.admits("192.0.2.1", basic(PASSWORD)) and gate.compute_remaining_lockout_s("192.0.2.1") == 0.0


def test_a_missing_password_is_not_a_guess():
    gate = PasswordGate(PASSWORD)
    for _ in range(10 * MAX_FAILURES):
        gate.admits("192.0.2.1", "")
    assert gate.admits("192.0.2.1", basic(PASSWORD))


def test_one_computer_cannot_use_many_ipv6_addresses():
    gate = PasswordGate(PASSWORD)
    for number in range(MAX_FAILURES):
        gate.admits(f"2001:db8::{number:x}", basic("wrong"))
    assert (
        gate.compute_remaining_lockout_s("2001:db8::ffff") > 0.0
        and gate.compute_remaining_lockout_s("2001:db8:0:1::1") == 0.0
    )


def test_many_addresses_do_not_fill_the_memory():
    gate = PasswordGate(PASSWORD)
    for _ in range(MAX_FAILURES):
        gate.admits("192.0.2.1", basic("wrong"))
    for number in range(999):
        gate.admits(f"10.0.{number // 256}.{number % 256}", basic("wrong"))
    assert gate.compute_remaining_lockout_s("192.0.2.1") > 0.0
    gate.admits("10.1.0.0", basic("wrong"))
    assert gate.compute_remaining_lockout_s("192.0.2.1") == 0.0, "only 1,000 addresses are stored"


def test_a_form_token_belongs_to_one_action():
    tokens = FormTokens()
    token = tokens.make("restart", "window")
    assert tokens.check("restart", "window", token)
    assert not tokens.check("restart", "edge", token) and not tokens.check("code", "window", token)
    assert not tokens.check("restart", "window", "") and not tokens.check("restart", "window", "é")
    assert not FormTokens().check("restart", "window", token)


@pytest.mark.parametrize(
    ("origin", "site", "same"),
    [
        ("", "", True),
        ("http://127.0.0.1:5590", "same-origin", True),
        ("http://evil.example", "", False),
        ("null", "", False),
        ("", "cross-site", False),
        ("http://127.0.0.1:5591", "same-site", False),
    ],
)
def test_requests_of_other_pages_are_recognised(origin, site, same):
    assert is_same_origin("127.0.0.1:5590", origin, site) is same


def test_a_valid_certificate_is_loaded(certificates):
    path, key = certificates.make("server", NOW, days=30)
    loaded = load_certificate(path, key, NOW.timestamp())
    assert (
        loaded.end_s
        == read_end(path)
        == pytest.approx((NOW + datetime.timedelta(days=30)).timestamp(), abs=1.0)
    )


@pytest.mark.parametrize(
    ("day", "word"), [(31, "expired on 2026-12-29"), (-1, "not valid before 2026-11-29")]
)
def test_a_certificate_of_another_time_is_refused(certificates, day, word):
    path, key = certificates.make("server", NOW, days=30)
    with pytest.raises(InputError, match=word):
        load_certificate(path, key, (NOW + datetime.timedelta(days=day)).timestamp())


def test_keys_that_do_not_fit_are_refused(certificates, tmp_path):
    path, key = certificates.make("server", NOW)
    _, other = certificates.make("other", NOW)
    with pytest.raises(InputError, match="does not belong to the certificate"):
        load_certificate(path, other, NOW.timestamp())
    key.chmod(0o644)
    with pytest.raises(InputError, match="mode 0644"):
        load_certificate(path, key, NOW.timestamp())
    key.chmod(0o600)
    key.write_text("no key")
    with pytest.raises(InputError, match="does not contain a private key"):
        load_certificate(path, key, NOW.timestamp())
    path.write_text("no certificate")
    with pytest.raises(InputError, match="does not contain a certificate"):
        load_certificate(path, key, NOW.timestamp())
    with pytest.raises(InputError):
        load_certificate(tmp_path / "none", key, NOW.timestamp())


def test_a_key_with_a_passphrase_is_refused_without_a_question(certificates):
    path, key = certificates.make("server", NOW, passphrase=b"secret")
    with pytest.raises(InputError, match="passphrase"):
        load_certificate(path, key, NOW.timestamp())


def test_a_port_that_is_taken_is_reported():
    with bind_port("127.0.0.1", 0, "") as first:
        port = first.getsockname()[1]
        with pytest.raises(ResourceError, match=f"127.0.0.1:{port}") as error:
            bind_port("127.0.0.1", port, "Choose another health.port.")
    assert "health.port" in error.value.remedy


def test_an_address_of_another_computer_is_reported():
    with pytest.raises(ResourceError, match=r"192\.0\.2\.1"):
        bind_port("192.0.2.1", 0, "")


@pytest.mark.parametrize(
    ("host", "is_this"),
    [
        ("127.0.0.1:5590", True),
        ("localhost", True),
        ("[::1]:5590", True),
        ("", False),
        ("evil.example:5590", False),
        ("127.0.0.1.evil.example", False),
        ("192.0.2.1:5590", False),
    ],
)
def test_only_names_of_the_loopback_name_this_computer(host, is_this):
    assert names_this_computer(host) is is_this


def test_tokens_have_one_form_and_never_repeat():
    tokens = {make_token() for _ in range(1000)}
    assert len(tokens) == 1000 and all(is_token(token) for token in tokens)
    for text in ("", "short", "../../../etc/password1", "a" * 23, "é" * 22, "a" * 22 + "\n"):
        assert not is_token(text)


def test_only_the_right_token_matches():
    token = make_token()
    assert tokens_match(token, token)
    assert not tokens_match("", token) and not tokens_match(token[:-1], token)
    assert not tokens_match("\udc80é", token)


def test_an_address_names_scheme_host_and_port():
    assert format_address("::1", 5588) == "http://[::1]:5588/"
    assert format_address("10.0.0.2", 5588, uses_tls=True) == "https://10.0.0.2:5588/"
    assert format_address("0.0.0.0", 5588) == f"http://{find_own_address()}:5588/"
