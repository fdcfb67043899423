"""Certificates and folders for the tests of the health page."""

from __future__ import annotations

from pathlib import Path

import pytest
from certificates import CertificateFolder


@pytest.fixture
def certificates(tmp_path: Path) -> CertificateFolder:
    """Makes certificates in the folder of the test."""
    folder = tmp_path / "certificates"
    folder.mkdir()
    return CertificateFolder(folder)


@pytest.fixture(autouse=True)
def own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Gives each test its own records and data, and refreshes the state more often than usual."""
    monkeypatch.setattr("enliven.health_page.collector.REFRESH_INTERVAL_S", 0.1)
    monkeypatch.setenv("ENLIVEN_RUNTIME", str(tmp_path / "runtime"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
