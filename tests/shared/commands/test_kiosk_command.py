"""Tests of ``enliven kiosk``: its checks, its programs, and their supervision."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from patience import wait_until

from enliven.commands import kiosk as command
from enliven.commands.kiosk import kiosk, kiosk_programs
from enliven.kiosk.profile import load_profile
from enliven.supervision.records import read_restarts, read_services
from enliven.wire import free_ports

PROFILE = """
[edges.edge]
arguments = ["--loop", "--speed", "0"]
port = {0}
[edges.stairs]
port = {1}
settings = "stairs.toml"
[edges.cellar]
address = "192.0.2.1"
[characters.throne]
parts = "legs"
[characters.horse]
mesh = "horse.obj"
[health]
port = {2}
[care]
recordings = "visits"
"""


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    (tmp_path / "visits").mkdir()
    (tmp_path / "stairs.toml").write_text("nodes = 64\n")
    (tmp_path / "horse.obj").write_text("v 0 0 0\n")
    path = tmp_path / "foyer.toml"
    path.write_text(PROFILE.format(free_ports()[0], free_ports()[0], free_ports()[0]))
    return path


def test_programs_have_the_options_of_the_profile(profile: Path) -> None:
    programs = {
        program.name: list(program.command) for program in kiosk_programs(load_profile(profile), profile)
    }
    assert list(programs) == ["edge", "edge stairs", "window", "health"], "an edge elsewhere is not started"
    edge = programs["edge stairs"]
    for option, value in (
        ("--settings", str(profile.parent / "stairs.toml")),
        ("--name", "stairs"),
        ("--record", str(profile.parent / "visits" / "stairs-{time}.mcap")),
        ("--keep-free", "1"),
    ):
        assert edge[edge.index(option) + 1] == value
    meshes = [edge[place + 1] for place, word in enumerate(edge) if word == "--mesh"]
    assert meshes == ["throne=chair", f"horse={profile.parent / 'horse.obj'}"]
    parts = [edge[place + 1] for place, word in enumerate(edge) if word == "--parts"]
    assert parts == ["legs", "all"]
    assert "--host" not in edge, "loopback is the default"
    assert programs["window"][-2:] == ["kiosk-window", str(profile)]
    assert programs["health"][-2:] == ["health", str(profile)]
    assert "window" not in {p.name for p in kiosk_programs(load_profile(profile), profile, window=False)}


def test_souvenirs_have_a_server_only_if_the_profile_makes_them(profile: Path) -> None:
    profile.write_text(f'{profile.read_text()}[souvenir]\nkind = "photo"\nhost = "0.0.0.0"\n')
    programs = {program.name: program for program in kiosk_programs(load_profile(profile), profile)}
    assert list(programs["souvenirs"].command)[-2:] == ["kiosk-souvenirs", str(profile)]


def test_missing_library_for_souvenirs_is_named(profile: Path, monkeypatch, capsys) -> None:
    text = f'{profile.read_text()}[souvenir]\nkind = "photo"\nhost = "0.0.0.0"\n'
    monkeypatch.setattr(command, "SOUVENIR_LIBRARIES", ("no_such_library",))
    monkeypatch.setenv("DISPLAY", ":9")
    for kind, code in (("photo", 4), ("", 0)):
        profile.write_text(text.replace('"photo"', f'"{kind}"'))
        with contextlib.suppress(typer.Exit):
            kiosk(profile, window=False, check=True)
        printed = capsys.readouterr().err
        assert (
            "the libraries for souvenirs are not installed: no_such_library" in printed and "[web]" in printed
        ) == (code == 4)


def test_mistakes_are_printed_and_nothing_starts(profile: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(command, "_supervise", lambda *_: pytest.fail("it must not start"))
    (profile.parent / "horse.obj").unlink()
    (profile.parent / "visits").rmdir()
    with pytest.raises(typer.Exit) as ended:
        kiosk(profile)
    lines = capsys.readouterr().err.splitlines()
    assert ended.value.exit_code == 3
    assert any("horse.obj" in line for line in lines) and any("visits" in line for line in lines)


def test_missing_screen_is_named(profile: Path, monkeypatch, capsys) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(typer.Exit) as ended:
        kiosk(profile, check=True)
    assert ended.value.exit_code == 4
    assert "no screen was found" in capsys.readouterr().err


def test_unknown_edge_is_refused(profile: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-c", OWN, str(profile), "--edge", "cellar"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 3
    assert "the profile has no edge 'cellar'" in run.stderr and "edge, stairs" in run.stderr


def test_edge_runs_in_the_process_that_systemd_started(profile: Path, monkeypatch) -> None:
    words: list[str] = []
    monkeypatch.setattr(command, "run_command", lambda given: words.extend(given) or 4)
    with pytest.raises(typer.Exit) as ended:
        kiosk(profile, edge="stairs")
    assert ended.value.exit_code == 4
    assert words[0] == "edge" and words[words.index("--name") + 1] == "stairs"
    assert words == kiosk_programs(load_profile(profile), profile)[1].command[3:]


OWN = """
import sys, typer
from enliven import cli
from enliven.commands import kiosk as command
from enliven.commands.kiosk import kiosk
command.list_installed_commands = lambda: {"edge": 1, "kiosk-window": 1, "health": 1}
command.kiosk_programs, original = (lambda *a, **k: STAND_INS or original(*a, **k)), command.kiosk_programs
STAND_INS = []
WAITS = "import time; time.sleep(600)"
app = typer.Typer()
app.command()(kiosk)
from enliven.errors import EnlivenError
try:
    code = typer.main.get_command(app)(sys.argv[1:], standalone_mode=False)
except EnlivenError as error:
    print(error, file=sys.stderr)
    sys.exit(error.exit_code)
except typer.Exit as ended:
    code = ended.exit_code
sys.exit(code)
"""
"""Runs the command in its own process, although this checkout's installation does not register it."""


@pytest.mark.slow
def test_killed_edge_comes_back_and_all_end_together(tmp_path: Path) -> None:
    path = tmp_path / "foyer.toml"
    ports = free_ports()
    path.write_text(
        f'[edges.edge]\narguments = ["--loop"]\nport = {ports[0]}\n[health]\nport = {free_ports()[0]}\n'
    )
    # Other tests cover the health page. A program that only waits replaces it here.
    stand_in = "command.enliven_command = lambda words, own=command.enliven_command: (\n"
    stand_in += (
        '    own(words) if words[0] == "edge" else [sys.executable, "-c", "import time; time.sleep(600)"])\n'
    )
    own = {**os.environ, "ENLIVEN_RUNTIME": str(tmp_path / "run"), "XDG_STATE_HOME": str(tmp_path / "state")}
    words = [sys.executable, "-c", OWN.replace("app =", stand_in + "app =", 1), str(path), "--no-window"]
    run = subprocess.Popen(words, env=own)

    def edge_pid() -> int:
        return next((s.pid for s in read_services(tmp_path / "run") if s.name == "edge"), 0)

    try:
        first = wait_until(edge_pid, "an edge")
        os.kill(first, signal.SIGKILL)
        second = wait_until(lambda: edge_pid() not in (0, first) and edge_pid(), "another edge")
        causes = [(each.name, each.cause) for each in read_restarts(tmp_path / "state" / "enliven")]
        assert causes == [("edge", "signal SIGKILL")]
        run.send_signal(signal.SIGTERM)
        assert run.wait(30) == 130
        assert not Path(f"/proc/{second}").exists()
    finally:
        run.kill()
        run.wait()
