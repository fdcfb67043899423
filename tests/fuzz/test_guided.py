"""Tests of coverage-guided fuzzing: it finds rare inputs, and survives hangs and crashes."""

import json
import os
import time
from pathlib import Path

import fuzz_guided
import fuzz_law
import pytest
import run
from patience import wait_until

atheris = pytest.importorskip("atheris", reason="atheris is not installed: pip install atheris")

pytestmark = pytest.mark.slow


@pytest.fixture
def turn(tmp_path):
    """Returns a function that fuzzes a reader for some seconds and returns the turn."""
    corpus, keep = tmp_path / "corpus", tmp_path / "keep"
    corpus.mkdir()
    keep.mkdir()
    number = iter(range(1, 1000))
    (corpus / "seed").write_bytes(b"start")

    def fuzz(read):
        target = fuzz_law.Target("reader", 1, (b"start",), read)
        with fuzz_law.room() as room:
            result = fuzz_guided.take_turn(target, 4.0, next(number), [corpus], Path(room), keep)
        return result, list(keep.iterdir())

    return fuzz


def deep(data, folder):
    """Raises an error only for inputs that start with two given bytes, which holds for one of 65,536 random
    inputs.
    """
    if len(data) < 2 or data[0] != 0xE1:
        return
    if data[1] == 0x3B:
        raise KeyError("found")


def test_coverage_leads_to_a_deep_fault(turn):
    atheris.instrument_func(deep)
    turns = []

    def found():
        turns.append(turn(deep))
        return turns[-1][1]

    wait_until(found, "the input that breaks the reader")
    result, kept = turns[-1]
    assert kept[0].read_bytes()[:2] == b"\xe1\x3b" and str(kept[0]) in result.broken[0]


def test_crash_of_the_process_keeps_the_input(turn):
    def read(data, folder):
        if len(data) > 20:
            os.abort()

    result, kept = turn(read)
    assert len(kept) == 1 and len(kept[0].read_bytes()) > 20
    assert "compiled code" in result.broken[0]


def test_hang_in_compiled_code_keeps_the_input(turn, monkeypatch):
    monkeypatch.setattr(fuzz_guided, "PATIENCE", 1.0)

    def read(data, folder):
        if len(data) > 20:
            time.sleep(600)  # like code that Python cannot stop; the limits of the child are far higher

    result, kept = turn(read)
    assert len(kept) == 1 and "longer than 4.0 s" in result.broken[0]


def test_kernels_stay_uninstrumented(tmp_path, monkeypatch):
    """Numba compiles byte code. With instrumented byte code of a kernel, reading a recording would fail."""
    monkeypatch.setattr(run, "OUT", tmp_path)
    assert run.main(["--seconds", "3", "--seed", "1", "--only", "recording chunk"]) == 0
    assert json.loads((tmp_path / "totals.json").read_text())["recording chunk"] > 10


def test_stored_input_is_read_again(tmp_path, capsys):
    path = tmp_path / "broken-mesh-off-00000000.bin"
    path.write_bytes(b"OFF\n1 1\n")
    assert run.main(["--repeat", str(path)]) == 0
    assert "mesh off: read, or refused" in capsys.readouterr().out
