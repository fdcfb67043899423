"""Tests of how `make test` treats failures: a failed test runs again, alone. If it fails twice, the run
fails.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parent.parent / "scripts" / "run_tests.py"
UNSTEADY = """
from pathlib import Path

def test_fails_the_first_time():
    mark = Path(__file__).with_suffix(".mark")
    known = mark.exists()
    mark.touch()
    assert known
"""
BROKEN = "def test_fails_always():\n    value = 3\n    assert value == 4\n"
MANY = "import pytest\n@pytest.mark.parametrize('k', range(6))\ndef test_fails(k):\n    assert k == 9\n"
ENDED_ONCE = """
import os, time
from pathlib import Path
import pytest

@pytest.mark.parametrize("k", range(12))
def test_waits(k):
    time.sleep(0.2)
    mark = Path(__file__).with_suffix(".mark")
    if k == 8 and not mark.exists():
        mark.touch()
        os._exit(3)
"""
STOPPED = "import os\ndef test_ends_its_process():\n    os._exit(3)\ndef test_after(): pass\n"


def run(folder: Path, **files: str) -> subprocess.CompletedProcess:
    """Runs test files in their own folder, like `make test`."""
    (folder / "pytest.ini").write_text("[pytest]\n")
    for name, text in files.items():
        (folder / f"test_{name}.py").write_text(text)
    command = [sys.executable, str(SCRIPT)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=900)


@pytest.mark.slow
def test_a_test_that_passes_alone_is_named_unsteady(tmp_path):
    result = run(tmp_path, unsteady=UNSTEADY, good="def test_passes():\n    pass\n")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "UNSTEADY (passes when repeated): test_unsteady.py::test_fails_the_first_time" in result.stdout


@pytest.mark.slow
def test_a_test_that_fails_twice_fails_the_run(tmp_path):
    result = run(tmp_path, unsteady=UNSTEADY, broken=BROKEN)
    assert result.returncode == 1
    assert "FAILED TWICE: test_broken.py::test_fails_always" in result.stdout
    assert "assert 3 == 4" in result.stdout, "the second run prints the values"
    assert "UNSTEADY (passes when repeated): test_unsteady.py" in result.stdout


@pytest.mark.slow
@pytest.mark.parametrize("text", [MANY, STOPPED, "import a_module_that_is_missing\n"])
def test_a_run_with_many_failures_or_without_an_end_fails(tmp_path, text):
    result = run(tmp_path, broken=text, unsteady="def test_passes():\n    pass\n")
    assert result.returncode != 0, result.stdout
    assert ("assert 4 == 9" in result.stdout) == (text == MANY)


@pytest.mark.slow
def test_what_a_process_left_runs_in_a_second_round(tmp_path):
    """On an idle machine it ends last. pytest-xdist would wait for ever for a process that replaces it."""
    quick = "import pytest\n@pytest.mark.parametrize('k', range(9))\ndef test_passes(k):\n    pass\n"
    result = run(tmp_path, last=ENDED_ONCE, a=quick, b=quick, c=quick, unsteady=UNSTEADY)
    assert result.returncode == 0, result.stdout + result.stderr
    assert re.search(r"Running the \d+ tests that did not finish", result.stdout)
    assert "UNSTEADY (passes when repeated): test_last.py::test_waits[8]" in result.stdout
    assert "UNSTEADY (passes when repeated): test_unsteady.py" in result.stdout


@pytest.mark.slow
def test_a_failure_among_what_a_process_left_fails_the_run(tmp_path):
    broken = ENDED_ONCE + "\ndef test_after():\n    assert False\n"
    result = run(tmp_path, last=broken, good="def test_passes():\n    pass\n")
    assert result.returncode == 1, result.stdout + result.stderr
    assert "FAILED TWICE: test_last.py::test_after" in result.stdout


@pytest.mark.slow
def test_a_run_without_failures_passes_and_repeats_nothing(tmp_path):
    result = run(tmp_path, good="def test_passes():\n    pass\n")
    assert result.returncode == 0 and "again, in one process" not in result.stdout
