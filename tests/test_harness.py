"""Tests of how the tests are run: the same examples every day, other orders, and useful tolerances."""

import importlib
import itertools
import subprocess
import sys
import time
from pathlib import Path

import hypothesis
import numpy as np
import pytest
from durations import recorded_durations, table_of
from hypothesis import given
from hypothesis import strategies as st
from patience import wait_until
from tolerances import SOLVER_TOLERANCE, are_alike, assert_alike

HERE = Path(__file__).parent
FILES = [str(HERE / "shared" / name) for name in ("test_health.py", "test_masks.py", "test_camera.py")]


def collected(*options: str) -> list[str]:
    """Returns the tests of three files in the order in which they would run."""
    command = [sys.executable, "-m", "pytest", "--collect-only", *options, *FILES]
    result = subprocess.run(command, capture_output=True, text=True, cwd=HERE.parent, timeout=300)
    assert result.returncode == 0, result.stdout
    return [line for line in result.stdout.splitlines() if "::" in line]


def seen_in_a_run() -> list[int]:
    """Returns the examples of one @given test, run in a new process."""
    seen = []

    @given(st.integers())
    def law(number: int) -> None:
        seen.append(number)

    law()
    return seen


def test_laws_see_the_same_examples_unless_asked_to_search():
    steady = hypothesis.settings.get_current_profile_name() == "steady"
    first, second = seen_in_a_run(), seen_in_a_run()
    assert len(first) > 50 and (first == second) == steady


def test_loaded_modules_do_not_change_the_examples(tmp_path, monkeypatch):
    if hypothesis.settings.get_current_profile_name() != "steady":
        pytest.skip("a random search may draw from the constants of the project")
    before = seen_in_a_run()
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "module_with_constants.py").write_text(f"NUMBERS = {list(range(10_000, 10_500))}\n")
    importlib.import_module("module_with_constants")
    try:
        assert seen_in_a_run() == before
    finally:
        del sys.modules["module_with_constants"]


@pytest.mark.slow
def test_a_shuffled_order_has_every_test_once_and_keeps_files_together():
    plain, shuffled, again = collected(), collected("--shuffle", "5"), collected("--shuffle", "5")
    assert shuffled == again != plain
    assert sorted(shuffled) == sorted(plain)
    files = [test.split("::")[0] for test in shuffled]
    assert len([1 for a, b in itertools.pairwise(files) if a != b]) == 2


@pytest.mark.slow
def test_the_longest_files_run_first():
    table = recorded_durations()
    assert len(table) > 50 and list(table.values()) == sorted(table.values(), reverse=True)
    assert [path for path in table if not path.is_file()] == [], "run: make test ARGS=--record-durations"
    shortest = str(list(table)[-1])
    command = [sys.executable, "-m", "pytest", "--collect-only", *FILES, shortest]
    output = subprocess.run(command, capture_output=True, text=True, cwd=HERE.parent, timeout=300).stdout
    files = [line.split("::")[0] for line in output.splitlines() if "::" in line]
    assert (HERE.parent / files[0]).samefile(shortest) and not (HERE.parent / files[-1]).samefile(shortest)
    seconds_of = {"tests/a/test_b.py": 7.4, "tests/test_c.py": 90.0, "tests/test_short.py": 0.1}
    assert table_of(seconds_of) == "90 test_c.py\n7 a/test_b.py\n"


def test_rounding_is_let_through_and_nothing_else():
    numbers = np.random.default_rng(0).normal(size=(40, 300))
    plain, other = numbers.sum(1), np.array([sum(row) for row in numbers])
    assert_alike(plain, other)
    assert_alike(plain.astype(np.float32), other)
    assert not are_alike(plain, other + 1e-9)
    assert are_alike(plain, other + 1e-10, SOLVER_TOLERANCE)
    assert not are_alike(plain[:, None], other), "of another shape"
    assert not are_alike(np.arange(3), np.array([0, 1, 3])), "whole numbers are the same or not"
    assert are_alike(np.array([1.0, np.nan]), np.array([1.0, np.nan]))
    assert not are_alike(np.array([1.0, np.nan]), np.array([1.0, 2.0]))


def test_a_wait_ends_with_what_it_waited_for_or_says_what_never_came():
    start = time.monotonic()
    assert wait_until(lambda: time.monotonic() > start + 0.02 and "there") == "there"
    with pytest.raises(AssertionError, match="the edge never came to be"):
        wait_until(lambda: False, "the edge", patience=0.01)
