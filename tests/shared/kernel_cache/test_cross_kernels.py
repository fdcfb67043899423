"""Tests that a machine with another processor can compile kernels for aarch64."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import zstandard

from enliven.kernel_cache import target
from enliven.kernel_cache.loading import unpickle_kernel
from enliven.kernel_cache.target import processor_levels
from enliven.kernels import quantile

SCRIPT = Path(__file__).parents[3] / "scripts" / "cross_kernels.py"
USE = """
import numpy as np
from enliven.kernels import copy_row, quantile
quantile(np.arange(3.0), 0.5)
copy_row(np.zeros(3), np.ones(3))
"""
ELF_MACHINE = slice(18, 20)
"""Bytes of an ELF file that contain the machine."""
AARCH64 = (183).to_bytes(2, "little")
"""Number of 64-bit ARM in ELF files."""

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="releases are made on Linux")


def run_python(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs Python with other kernel folders and levels than those of the test run."""
    return subprocess.run(
        [sys.executable, *words], env=os.environ | environment, capture_output=True, text=True, timeout=300
    )


@pytest.mark.slow
def test_kernels_are_compiled_for_aarch64_under_their_names_there(tmp_path, monkeypatch):
    here, there = tmp_path / "here", tmp_path / "there"
    for level in processor_levels():
        done = run_python("-c", USE, NUMBA_CACHE_DIR=str(here), NUMBA_CPU_NAME=level, NUMBA_CPU_FEATURES="")
        assert done.returncode == 0, done.stderr
    done = run_python(str(SCRIPT), str(here), str(there))
    assert done.returncode == 0, done.stderr
    stored = {
        path.name: unpickle_kernel(zstandard.decompress(path.read_bytes())) for path in there.glob("*.kernel")
    }
    assert sorted(data[1].qualname for data in stored.values()) == ["copy_row", "quantile"]
    monkeypatch.setattr(target.platform, "machine", lambda: "aarch64")
    arm = ("aarch64-unknown-linux-gnu", processor_levels()[0], "")
    for name, (library, descriptor, _, signature, *_) in stored.items():
        (machine_code, _) = library[2]
        assert machine_code[ELF_MACHINE] == AARCH64
        if descriptor.qualname == "quantile":
            assert name == quantile._cache.file_name(signature.args, arm)


@pytest.mark.slow
def test_kernel_that_no_longer_exists_is_named(tmp_path):
    (tmp_path / "gone.py").write_text(
        "from enliven.kernels import njit\n\n\n@njit(cache=True)\ndef half(x):\n    return x / 2\n"
    )
    path = f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    words = {"NUMBA_CACHE_DIR": str(tmp_path / "here"), "PYTHONPATH": path}
    assert run_python("-c", "import gone; gone.half(1.0)", **words).returncode == 0
    (tmp_path / "gone.py").write_text("")
    done = run_python(str(SCRIPT), str(tmp_path / "here"), str(tmp_path / "there"), **words)
    assert done.returncode != 0
    assert "gone.half(float64,) cannot be compiled for aarch64" in done.stderr
