"""Provides certificates for the tests of web servers."""

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
