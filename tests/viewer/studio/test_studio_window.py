"""Tests of the studio's real window with ImGui's test engine, if there is a display or Xvfb."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from in_a_window import in_a_window
from typer.testing import CliRunner

from enliven.errors import ResourceError
from enliven_viewer.commands.studio import studio

SESSION = Path(__file__).parents[1] / "studio_session.py"


@pytest.mark.slow
def test_an_artist_works_in_the_window(tmp_path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    assert report["done"] and report["spread"] > 5, report
    assert report["tool"] == "carry" and report["merged"] == ["two"] and report["undone"] == ["one", "two"], (
        report
    )
    assert report["caged"] == ["post", ["post"]], "a fourth rig is in the list and on the timeline"
    assert report["chosen"] == "two" and report["renamed"] == ["mantle", "one"]
    assert report["copied"] == ["mantle", "mantle 2", "one"] and report["after ctrl z"] == ["mantle", "one"]
    assert report["source"] == ["map", "wave"] and report["playing"] and report["help"] == "help"
    assert report["asks"] == "unsaved" and report["stays"] and report["over"]
    assert report["left"] == [], "nothing is left to recover"


def test_command_without_a_display_gives_advice(monkeypatch) -> None:
    monkeypatch.setattr("enliven_viewer.commands.studio.has_display", lambda: False)
    app = typer.Typer()
    app.command()(studio)
    done = CliRunner().invoke(app, [])
    assert isinstance(done.exception, ResourceError) and "xvfb-run" in str(done.exception)
    assert "enliven studio SQUID.enliven" in CliRunner().invoke(app, ["--help"]).output
