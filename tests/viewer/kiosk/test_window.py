"""Tests of the kiosk's real window: it fills the screen, stays open, and refuses invalid profiles."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from in_a_window import in_a_window
from typer.testing import CliRunner

from enliven.errors import ResourceError
from enliven_viewer.commands.kiosk_window import kiosk_window

SESSION = Path(__file__).parents[1] / "kiosk_session.py"
PROFILE = """
[edges.floor]
port = 9
[characters.chair]
mesh = "chair"
[story]
language = "de"
"""


def write_profile(folder: Path, more: str = "") -> Path:
    """Returns the path of a profile."""
    path = folder / "kiosk.toml"
    path.write_text(PROFILE + more, encoding="utf-8")
    return path


@pytest.mark.slow
def test_window_fills_the_screen_and_stays_open(tmp_path):
    report = in_a_window(SESSION, str(write_profile(tmp_path)), str(tmp_path), screen="480x270x24")
    assert report["size"] == [480, 270]
    assert report["picture"] == [270, 480]
    assert not report["decorated"]
    assert report["cursor_hidden"]
    assert not report["closes_by_escape"]
    assert not report["closes_by_q"]
    assert report["closes_by_all_three"]
    assert report["changed"] > 0.01, "the picture moves"
    assert report["gl_error"] == "GL_NO_ERROR"
    assert report["picture_of_screen"]
    assert report["service"] == ["window"]
    assert "another kiosk already uses screen 0" in report["second"]


@pytest.mark.slow
def test_upright_monitor_gets_an_upright_picture(tmp_path):
    path = write_profile(tmp_path, '[screen]\nturn = 90\nsize = "320x200"\n')
    report = in_a_window(SESSION, str(path), str(tmp_path), screen="480x270x24")
    assert report["size"] == [320, 200]
    assert report["picture"] == [320, 200]


@pytest.mark.slow
def test_command_ends_by_sigterm(tmp_path):
    if shutil.which("xvfb-run") is None and not os.environ.get("DISPLAY"):
        pytest.skip("there is no display, and no xvfb-run to make one")
    program = (
        "import typer; from enliven_viewer.commands.kiosk_window import kiosk_window; typer.run(kiosk_window)"
    )
    command = [sys.executable, "-c", program, str(write_profile(tmp_path))]
    display = [] if os.environ.get("DISPLAY") else ["xvfb-run", "-a", "-s", "-screen 0 320x200x24"]
    environment = {**os.environ, "ENLIVEN_RUNTIME": str(tmp_path)}
    started = subprocess.Popen(
        [*display, *command], env=environment, start_new_session=True, stderr=subprocess.PIPE, text=True
    )
    try:
        deadline = time.monotonic() + 120.0
        record = tmp_path / "services" / "window.json"
        while not record.is_file() and started.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.1)
        assert started.poll() is None, started.stderr.read()
        import msgspec

        os.kill(msgspec.json.decode(record.read_bytes())["pid"], signal.SIGTERM)
        started.wait(60.0)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(started.pid, signal.SIGKILL)


def test_missing_screen_is_explained(tmp_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    if sys.platform in ("win32", "darwin"):
        pytest.skip("a screen is always there")
    with pytest.raises(ResourceError, match="no screen was found"):
        kiosk_window(write_profile(tmp_path), None)


def test_help_names_the_keys_that_close_it():
    import typer

    app = typer.Typer()
    app.command()(kiosk_window)
    result = CliRunner().invoke(app, ["--help"])
    assert result.exit_code == 0
    assert "Ctrl+Alt+Q" in result.output
