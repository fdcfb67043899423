"""Tests of the password and the certificate that the health page needs beyond loopback."""

from __future__ import annotations

from pathlib import Path

import pytest

from enliven.errors import InputError
from enliven.health_page.server import check_access
from enliven.kiosk.profile import HealthPageSettings

PASSWORD = "correct horse"


def password_file(folder: Path, text: str = f"{PASSWORD}\n", mode: int = 0o600) -> Path:
    path = folder / "password"
    path.write_text(text)
    path.chmod(mode)
    return path


def test_beyond_loopback_a_password_and_tls_are_needed(tmp_path, certificates):
    path, key = certificates.make("server")
    password = str(password_file(tmp_path))
    for host in ("0.0.0.0", "::", "192.0.2.1", "health.example"):
        for settings in (
            HealthPageSettings(host=host),
            HealthPageSettings(host=host, password_file=password),
            HealthPageSettings(host=host, certificate=str(path), certificate_key=str(key)),
        ):
            with pytest.raises(InputError, match="needs") as error:
                check_access(settings)
            assert host in str(error.value) and "127.0.0.1" in error.value.remedy
    complete = HealthPageSettings(
        host="0.0.0.0", password_file=password, certificate=str(path), certificate_key=str(key)
    )
    assert check_access(complete).certificate is not None and not check_access(complete).is_local
    assert check_access(HealthPageSettings()).gate is None


def test_a_certificate_without_its_key_is_refused():
    with pytest.raises(InputError, match="only one of"):
        check_access(HealthPageSettings(certificate="cert.pem"))
