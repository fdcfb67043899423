"""Tests of the Play window, if there is a display or Xvfb, and of the command that opens it."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from in_a_window import in_a_window
from typer.testing import CliRunner

from enliven.errors import InputError, ResourceError
from enliven_viewer.commands.view import parse_addresses, view
from enliven_viewer.doctor import run_checks
from enliven_viewer.settings import ViewerSettings, with_size

SESSION = Path(__file__).parents[1] / "window_session.py"
AUDIENCE = Path(__file__).parents[1] / "audience_session.py"


@pytest.mark.slow
def test_a_window_shows_the_scene_and_heeds_its_keys(tmp_path: Path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    assert report["frames"] >= 15 and report["spread"] > 5 and report["errors"] == []
    assert report["asked"] == [
        ["possess", "box", None, "all", "alone"],
        ["possess", "box", None, "legs", "preview"],
        ["possess", "box", 7, "legs", "preview"],
        ["possess", "box", 7, "legs", "join"],
        ["possess", "box", 7, "legs", "extend"],
        ["release", "box", 7],
    ]
    assert report["help"] == "help"
    assert report["look"] == {"body": 0.0, "reveal": 0.0, "cues": 0.0, "graph": 1.0, "held": 1.0}
    assert not report["live"] and report["paused"] and report["speed"] == 2.0
    assert report["notice"] == "" and report["size"][2] == 640
    assert report["full"][2] > 640 and report["again"] == report["size"], (
        "F11 fills the screen, and goes back"
    )
    assert report["over"], "Escape ends a window that was opened to watch"


@pytest.mark.slow
def test_window_without_an_edge_names_the_address(tmp_path: Path) -> None:
    report = in_a_window(SESSION, str(tmp_path), "empty")
    assert report["notice"] == "Waiting for a stage at 127.0.0.1:5580"
    assert report["spread"] > 3 and report["errors"] == []


@pytest.mark.slow
def test_a_bare_window_is_the_picture_alone(tmp_path: Path) -> None:
    report = in_a_window(SESSION, str(tmp_path), "bare")
    assert report["size"] == [0, 0, 640, 480] and report["spread"] > 5 and report["over"]


@pytest.mark.slow
def test_an_audience_sees_the_performance_alone_and_no_frozen_picture(tmp_path: Path) -> None:
    report = in_a_window(AUDIENCE, str(tmp_path))
    assert report["done"], report
    assert report["widgets"] == [] and report["area"] == [[0.0, 0.0], True], "no menu, no panel, no timeline"
    assert report["live"] == ["", True]
    assert report["words"] == "The connection to the stage is lost. The program reconnects by itself."
    assert report["replays"] == [True, True] and report["moves"] > 0.05, "what was performed last goes on"
    assert report["back"] == ["", True], "the edge is followed again"
    assert report["windowed"] == [False, True] and report["again"] == [True, False], (
        "F11 is the way to the menus"
    )


def command() -> typer.Typer:
    app = typer.Typer()
    app.command()(view)
    return app


def test_without_a_display_the_command_tells_of_films(monkeypatch) -> None:
    monkeypatch.setattr("enliven_viewer.commands.view.has_display", lambda: False)
    done = CliRunner().invoke(command(), [])
    assert isinstance(done.exception, ResourceError) and "--film" in str(done.exception)


def test_missing_take_is_reported(tmp_path) -> None:
    done = CliRunner().invoke(command(), [str(tmp_path / "none.mcap"), "--film", str(tmp_path / "f.mp4")])
    assert isinstance(done.exception, InputError) and "none.mcap" in str(done.exception)


def test_help_has_worked_examples() -> None:
    done = CliRunner().invoke(command(), ["--help"])
    assert done.exit_code == 0 and "enliven view --film out.mp4" in done.output


@pytest.mark.parametrize("text", ["1280", "0x0", "axb", "99999x10", "-5x10"])
def test_invalid_size_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="not a size"):
        with_size(ViewerSettings(), text)


def test_sizes_and_addresses_are_parsed() -> None:
    assert (with_size(ViewerSettings(), "640 x 360").width, with_size(ViewerSettings(), None).width) == (
        640,
        1280,
    )
    assert parse_addresses(["10.0.0.2"], None, None) == ["10.0.0.2:5580:5581"]
    assert parse_addresses(["10.0.0.2:7000"], None, None) == ["10.0.0.2:7000:7001"]
    assert parse_addresses(["10.0.0.2:7000"], 8000, 9000) == ["10.0.0.2:8000:9000"]
    assert parse_addresses(["10.0.0.2"], 8000, None) == ["10.0.0.2:8000:8001"]
    several = parse_addresses(["10.0.0.2", "10.0.0.3:7000"], None, None)
    assert several == ["10.0.0.2:5580:5581", "10.0.0.3:7000:7001"]
    with pytest.raises(InputError, match="several edges"):
        parse_addresses(["10.0.0.2", "10.0.0.3"], 8000, None)


def test_the_doctor_looks_at_what_the_viewer_needs() -> None:
    by_name = {check.name: check for check in run_checks()}
    assert set(by_name) == {"OpenGL off-screen", "window", "film encoder"}
    assert all(check.ok or check.remedy for check in by_name.values())
