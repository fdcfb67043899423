"""Puppets in the studio's real window, where there is a display or Xvfb."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SESSION = Path(__file__).parents[1] / "studio_puppets_session.py"


def test_an_artist_poses_a_puppet_in_the_window(tmp_path) -> None:
    command = [sys.executable, str(SESSION), str(tmp_path)]
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        if shutil.which("xvfb-run") is None:
            pytest.skip("there is no display, and no xvfb-run to make one")
        command = ["xvfb-run", "-a", "-s", "-screen 0 1280x800x24", *command]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["done"] and said["bad"] == [], said
    assert said["points"] == 4 and said["pose"][0] == 0, said
    across, up, towards = said["pose"][1]
    assert up > 0.03 and across == towards == 0.0, "the green arrow moves along y alone"
    assert "point 1 goes through" in said["warning"] and said["red"] > 100, said
    assert said["changed"] > 500 and not said["left"] and said["playing"], said
