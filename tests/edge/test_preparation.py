"""Tests that a second process compiles missing tracker kernels while the edge prepares its characters."""

import numba
import pytest

from enliven_edge.commands import preparation
from enliven_edge.commands.preparation import TrackerCompilation


def compile_something() -> None:
    numba.njit(lambda x: x + 1)(1)


@pytest.mark.slow
def test_the_first_compilation_starts_the_process_once():
    with TrackerCompilation() as tracker:
        assert tracker._process is None
        assert not tracker.is_running
        compile_something()
        process = tracker._process
        assert tracker.is_running
        compile_something()
        assert tracker._process is process
        tracker.wait()
        assert process.returncode == 0, "it has compiled and tracked"
        assert not tracker.is_running
        compile_something()
        assert tracker._process is process


def test_a_machine_with_all_kernels_starts_no_process():
    with TrackerCompilation() as tracker:
        tracker.wait()
        assert tracker._process is None
    compile_something()
    assert tracker._process is None


@pytest.mark.parametrize(("folder", "cores"), [(None, 4), ("folder", 1)])
def test_no_useless_warm_up_process_is_started(monkeypatch, folder, cores):
    monkeypatch.setattr(preparation, "user_folder", lambda: folder)
    monkeypatch.setattr(preparation.os, "cpu_count", lambda: cores)
    with TrackerCompilation() as tracker:
        compile_something()
        assert tracker._process is None


def test_an_interrupted_preparation_leaves_no_process():
    with pytest.raises(KeyboardInterrupt), TrackerCompilation() as tracker:
        compile_something()
        raise KeyboardInterrupt
    assert tracker._process.returncode is not None
