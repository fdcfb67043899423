"""Builds the panel's firmware once. Without its compiler and its simulator these tests are skipped."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from panel_for_tests import build, missing


@pytest.fixture(scope="session")
def firmware(tmp_path_factory):
    if why := missing():
        pytest.skip(why)
    return build(tmp_path_factory.mktemp("panel"))
