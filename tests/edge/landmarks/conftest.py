"""Adds this folder, which is not a package, to the import path, for the module with the true landmarks."""

import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def landmarks_of():
    """Returns ``truth.landmarks_of``."""
    spec = importlib.util.spec_from_file_location("landmark_truth", Path(__file__).with_name("truth.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.landmarks_of
