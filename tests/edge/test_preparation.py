"""Tests that a second process compiles missing tracker kernels while the edge prepares its characters."""

import subprocess

import numba
import pytest

from enliven_edge.commands import preparation
from enliven_edge.commands.preparation import TrackerCompilation


def compile_something() -> None:
    numba.njit(lambda x: x + 1)(1)


@pytest.fixture
def processes(monkeypatch) -> list[subprocess.Popen]:
    """Returns a list that gets each started process."""
    started: list[subprocess.Popen] = []

    class Watched(subprocess.Popen):
        def __init__(self, *args, **options):
            super().__init__(*args, **options)
            started.append(self)

    monkeypatch.setattr(preparation.subprocess, "Popen", Watched)
    return started


@pytest.mark.slow
def test_the_first_compilation_starts_the_process_once(processes):
    with TrackerCompilation() as tracker:
        assert not processes and not tracker.is_running
        compile_something()
        assert len(processes) == 1 and tracker.is_running
        compile_something()
        tracker.wait()
        assert processes[0].returncode == 0, "it has compiled and tracked"
        assert not tracker.is_running
        compile_something()
    assert len(processes) == 1


def test_a_machine_with_all_kernels_starts_no_process(processes):
    with TrackerCompilation() as tracker:
        tracker.wait()
    compile_something()
    assert not processes


@pytest.mark.parametrize(("folder", "cores"), [(None, 4), ("folder", 1)])
def test_no_useless_warm_up_process_is_started(monkeypatch, processes, folder, cores):
    monkeypatch.setattr(preparation, "user_folder", lambda: folder)
    monkeypatch.setattr(preparation.os, "cpu_count", lambda: cores)
    with TrackerCompilation():
        compile_something()
    assert not processes


def test_an_interrupted_preparation_leaves_no_process(processes):
    with pytest.raises(KeyboardInterrupt), TrackerCompilation():
        compile_something()
        raise KeyboardInterrupt
    assert len(processes) == 1 and processes[0].returncode is not None
