"""Tests that the list of commands and each command's help import no numerical library, so that they appear at
once.
"""

import os
import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest

from enliven.cli import build_command_group
from enliven.commands.lazy import LazyCommands, command_summary, list_installed_commands, run_command
from enliven.errors import InputError
from enliven.kernel_cache.program import PROGRAM_VARIABLE

HEAVY = ("numpy", "numba", "scipy", "msgspec", "trimesh", "moderngl", "zmq")
"""Libraries that take between 0.1 and 2 s to import."""

ASKED = f"""
import contextlib, io, sys
from enliven import cli
for words in {{lists}}:
    with contextlib.redirect_stdout(io.StringIO()) as shown:
        assert cli.run([*words, "--help"]) == 0, words
    assert "Usage: " in shown.getvalue()
    print(*words, *(name for name in {HEAVY} if name in sys.modules))
"""


def imported_by_help_of(*lists: list[str]) -> list[str]:
    """Returns a line for each command line: its words, and the heavy libraries that its help has imported."""
    code = ASKED.format(lists=list(lists))
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=True
    ).stdout.splitlines()


def test_the_list_of_commands_imports_no_command():
    assert imported_by_help_of([]) == [""]


@pytest.mark.slow
def test_the_help_of_every_command_imports_nothing_heavy():
    names = [[name] for name in list_installed_commands()]
    assert imported_by_help_of(*names) == [name for (name,) in names]


def test_a_summary_is_the_first_line_of_the_command_s_help():
    group = build_command_group()
    assert isinstance(group, LazyCommands)
    for name, entry in list_installed_commands().items():
        first = command_summary(entry)
        assert first and group.get_command(None, name).help.startswith(first), name


def test_command_of_broken_package_is_listed_and_reports_the_error(monkeypatch, capsys):
    broken = EntryPoint("broken", "enliven.no_such_module:broken", "enliven.commands")
    monkeypatch.setattr("enliven.commands.lazy.list_installed_commands", lambda: {"broken": broken})
    from enliven import cli

    assert cli.run(["--help"]) == 0
    assert "\n  broken" in capsys.readouterr().out
    assert cli.run(["broken"]) == 1
    assert "'broken' cannot be loaded: No module named 'enliven.no_such_module'" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["vieww", "edg"])
def test_a_misspelt_command_is_wrong_usage_and_names_the_nearest(name, capsys):
    from enliven import cli

    assert cli.run([name]) == 2
    assert f"'{name}'" in capsys.readouterr().err


def test_command_runs_another_one_in_its_process(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(PROGRAM_VARIABLE, "kiosk")
    assert run_command(["graph", "--help"]) == 0
    assert "Usage: enliven graph" in capsys.readouterr().out
    assert os.environ[PROGRAM_VARIABLE] == "graph", "its own kernels are used"
    assert run_command(["kiosk", str(tmp_path / "gone.toml"), "--check", "--no-window"]) == 3
    with pytest.raises(InputError, match=r"gone\.toml"):
        run_command(["health", str(tmp_path / "gone.toml")])
