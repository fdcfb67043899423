"""Runs a session in the studio's real window, if there is a display or Xvfb."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest


def in_a_window(session: Path, *arguments: str, seconds: float = 400.0, screen: str = "1400x900x24") -> dict:
    """Runs a session in the real window and returns its output. Fails after ``seconds``.

    Args:
        screen: size in pixels and colour depth in bits of the virtual screen, which is created if there
            is no screen.
    """
    command = [sys.executable, str(session), *arguments]
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        if shutil.which("xvfb-run") is None:
            pytest.skip("there is no display, and no xvfb-run to make one")
        command = ["xvfb-run", "-a", "-s", f"-screen 0 {screen}", *command]
    # The processes have their own group, so that window, edge and Xvfb end with a test that timed out.
    started = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        out, wrong = started.communicate(timeout=seconds)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(started.pid, signal.SIGKILL)
    assert started.returncode == 0, wrong
    return json.loads(out.splitlines()[-1])
