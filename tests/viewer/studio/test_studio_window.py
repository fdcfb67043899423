"""Tests of the studio's real window with ImGui's test engine, if there is a display or Xvfb."""

from __future__ import annotations

from pathlib import Path

import typer
from in_a_window import in_a_window
from typer.testing import CliRunner

from enliven.errors import ResourceError
from enliven_viewer.commands.studio import studio

SESSION = Path(__file__).parents[1] / "studio_session.py"


def test_an_artist_works_in_the_window(tmp_path) -> None:
    said = in_a_window(SESSION, str(tmp_path))
    assert said["done"] and said["spread"] > 5, said
    assert said["tool"] == "carry" and said["merged"] == ["two"] and said["undone"] == ["one", "two"], said
    assert said["caged"] == ["post", ["post"]], "a fourth rig is in the list and on the timeline"
    assert said["chosen"] == "two" and said["renamed"] == ["mantle", "one"]
    assert said["copied"] == ["mantle", "mantle 2", "one"] and said["after ctrl z"] == ["mantle", "one"]
    assert said["source"] == ["map", "wave"] and said["playing"] and said["help"] == "help"
    assert said["asks"] == "unsaved" and said["stays"] and said["over"]
    assert said["left"] == [], "nothing is left to recover"


def test_command_without_a_display_gives_advice(monkeypatch) -> None:
    monkeypatch.setattr("enliven_viewer.commands.studio.has_display", lambda: False)
    app = typer.Typer()
    app.command()(studio)
    done = CliRunner().invoke(app, [])
    assert isinstance(done.exception, ResourceError) and "xvfb-run" in str(done.exception)
    assert "enliven studio SQUID.enliven" in CliRunner().invoke(app, ["--help"]).output
