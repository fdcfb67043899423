"""Runs a session in the studio's real window, where there is a display or Xvfb."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest


def in_a_window(session: Path, *arguments: str, seconds: float = 400.0) -> dict:
    """What a session in the real window printed within so many seconds."""
    command = [sys.executable, str(session), *arguments]
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        if shutil.which("xvfb-run") is None:
            pytest.skip("there is no display, and no xvfb-run to make one")
        command = ["xvfb-run", "-a", "-s", "-screen 0 1400x900x24", *command]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])
