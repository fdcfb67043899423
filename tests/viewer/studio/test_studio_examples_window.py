"""The example panel in the studio's real window, where there is a display or Xvfb."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SESSION = Path(__file__).parents[1] / "studio_examples_session.py"


def test_a_star_acts_after_two_poses_in_the_window(tmp_path) -> None:
    command = [sys.executable, str(SESSION), str(tmp_path)]
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        if shutil.which("xvfb-run") is None:
            pytest.skip("there is no display, and no xvfb-run to make one")
        command = ["xvfb-run", "-a", "-s", "-screen 0 1280x800x24", *command]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["done"] and said["spread"] > 5 and said["bad"] == [], said
    assert said["chosen"] and said["plays"] == ["sway"] and said["paired"] == "bone 3" and said["foot"], said
    assert said["joints"] and said["editing"] == 1 and said["poses"] == 2 and said["problem"] == "None", said
    assert said["retimed"] and said["duplicated"] == 3 and said["removed"] == 2, said
    assert said["time"] > 0.2 and said["held"] == 1 and said["left"] and said["again"], said
