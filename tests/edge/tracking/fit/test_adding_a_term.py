"""Tests that adding a term to the fit changes only ``terms.py`` and the settings for its weight."""

import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import enliven_edge
from enliven_edge.tracking.fit import terms

KERNEL = '''
@njit(cache=True, nogil=True)
def below_ceiling(sums, surface, weight, height):
    """Adds the term that keeps the balls at both ends of every capsule below ``height`` metres."""
    up, stretch, energy = np.array([0.0, 1.0, 0.0]), np.zeros(len(sums.tug)), 0.0
    for c in range(len(surface.ends)):
        for e in range(2):
            residual = surface.ends[c, e, 1] + surface.radii[c, e] - height
            if residual > 0.0:
                energy += weight * residual * residual
                at, lengths_of = surface.ends[c, e], surface.lengths_of
                add_direction_residual(sums, surface.frame[c], up, at, stretch, lengths_of, residual, weight)
    return energy


'''
CALL = "    energy += below_ceiling(sums, surface, weights.ceiling * SQUARE_CM, 1.5)\n"
WEIGHT = (
    "    ceiling: float = parameter(0.0, \"Weight of 'no limb above the ceiling'.\", low=0.0, high=100.0)\n"
)
PATCHES = {
    "tracking/fit/terms.py": [
        ("@njit(cache=True, nogil=True)\ndef assemble(", KERNEL.lstrip()),
        ("    energy += above_floor(", CALL),
    ],
    "tracking/settings.py": [("    temporal: float = parameter(", WEIGHT)],
}
"""By file: a text to find, and the text to insert before it."""
FIT = """
    import numpy as np
    from enliven_edge.tracking.body_model.posture import Posture
    from enliven_edge.tracking.body_model import joint_limits, model
    from enliven_edge.tracking.fit.fit import Fitter
    from enliven_edge.tracking.frame.observation import ImageView, Observation, stack_rows
    from enliven_edge.tracking.settings import FitSettings

    standing = joint_limits.standing_pose()
    posture = Posture(np.array([0.0, 0.95, -2.5]), standing, model.lengths_for_height(1.7))
    ends = posture.capsules()[0].reshape(-1, 3).astype(np.float32)
    normals = np.tile(np.float32([0, 0, 1]), (len(ends), 1))
    empty = np.zeros((4, 4))
    view = ImageView(empty, empty > 0, np.full((4, 4), -1), np.array([130.0, 130.0, 2.0, 2.0]), np.eye(4))
    seen = Observation(ends, stack_rows(ends, normals), np.zeros((len(ends), 2), int), view, False)
    for ceiling in (0.0, 20.0):
        fitted, report = Fitter(FitSettings(ceiling=ceiling)).fit(seen, posture, iterations=3)
        print(float(fitted.capsules()[0][..., 1].max()), report.energy)
"""


@pytest.mark.slow
def test_a_term_is_added_in_two_files(tmp_path: Path) -> None:
    """In a copy of the package without compilation, a ceiling term makes the head bend down."""
    home = Path(enliven_edge.__file__).parent
    ignored = shutil.ignore_patterns("__pycache__", "*.mcap", "*.npz", "*.onnx")
    shutil.copytree(home, tmp_path / "enliven_edge", ignore=ignored)
    for name, patches in PATCHES.items():
        file = tmp_path / "enliven_edge" / name
        text = file.read_text()
        for before, added in patches:
            assert text.count(before) == 1, before
            text = text.replace(before, added + before)
        file.write_text(text)
    assert len(PATCHES) == 2 and Path(terms.__file__).name == "terms.py"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", textwrap.dedent(FIT)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=300)
    (free, low), (bowed, high) = (map(float, line.split()) for line in done.stdout.splitlines())
    assert bowed < free - 0.05 and high > low
