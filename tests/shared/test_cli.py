"""Tests of the command line: meaningful exit codes, and never a traceback."""

import json
import logging
import subprocess
import sys

import pytest

from enliven import cli
from enliven.commands.processes import Process, run_together
from enliven.doctor import Check, run_all_checks
from enliven.errors import InputError, ResourceError
from enliven.logs import JsonLinesFormatter


def enliven(*arguments: str, **options) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "enliven", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)


def test_help_lists_the_commands_of_every_package():
    shown = enliven("--help")
    assert shown.returncode == 0
    for name in ("run", "edge", "view", "import", "record", "replay", "doctor"):
        assert f"\n  {name} " in shown.stdout


def test_wrong_usage_exits_with_2():
    asked = enliven("edge", "--no-such-option")
    assert asked.returncode == 2
    assert "Traceback" not in asked.stderr


@pytest.mark.parametrize(
    ("error", "code"),
    [(InputError("a"), 3), (ResourceError("b"), 4), (KeyboardInterrupt(), 130), (ValueError("c"), 1)],
)
def test_errors_have_their_exit_codes(monkeypatch, capsys, error, code):
    def application():
        def command(*arguments, **options):
            raise error

        return command

    monkeypatch.setattr(cli, "build_command_group", application)
    assert cli.run([]) == code
    assert "Traceback" not in capsys.readouterr().err


def test_missing_recording_is_reported():
    asked = enliven("run", "--recording", "nowhere.mcap")
    assert asked.returncode == 3
    assert "nowhere.mcap: the recording does not exist" in asked.stderr
    assert "Traceback" not in asked.stderr
    unset = enliven("run", "--settings", "nowhere.toml")
    assert unset.returncode == 3 and "nowhere.toml: the settings file does not exist" in unset.stderr


def test_doctors_commands_are_complete(monkeypatch, capsys):
    lacking = Check("[OAK]", False, "it lacks [one thing]", 'Type: pip install "enliven-edge[oak]"')
    monkeypatch.setattr("enliven.commands.doctor.run_all_checks", lambda: [lacking])
    cli.run(["doctor"])
    output = " ".join(capsys.readouterr().out.split())
    assert output.endswith('[OAK] it lacks [one thing] Type: pip install "enliven-edge[oak]"')


def test_doctor_as_json():
    result = enliven("doctor", "--json")
    checks = json.loads(result.stdout)
    assert {"name", "ok", "detail", "mend"} == set(checks[0])
    assert {"Python", "compiled kernels"} <= {check["name"] for check in checks}
    assert result.returncode == (0 if all(check["ok"] for check in checks) else 4)


def test_every_missing_item_has_a_fix():
    for check in run_all_checks():
        assert isinstance(check, Check)
        assert check.ok or check.remedy, check.name


def test_log_is_written_as_json_lines():
    record = logging.makeLogRecord(
        {"name": "enliven", "levelname": "INFO", "msg": "a %s", "args": ("b",), "port": 3}
    )
    line = json.loads(JsonLinesFormatter().format(record))
    assert line["message"] == "a b"
    assert line["port"] == 3
    assert line["level"] == "info"


@pytest.mark.slow
def test_a_cut_recording_is_read_with_one_sentence(tmp_path):
    from enliven_edge.assets import CHAIR

    cut = tmp_path / "cut.mcap"
    cut.write_bytes(CHAIR.read_bytes()[:1_500_000])
    ports = ["--port", "0", "--control-port", "0", "--name", "cut"]
    asked = enliven("edge", "--recording", str(cut), "--speed", "0", "--seconds", "0.5", *ports)
    assert asked.returncode == 0
    lines = [line for line in asked.stderr.splitlines() if "cut.mcap" in line]
    assert len(lines) == 1
    assert lines[0].startswith("enliven: ")
    assert "cut off" in lines[0]


def test_processes_end_together():
    """The leading program ends at once with 0. The other one would run for ever."""
    follower = Process("follower", ["doctor", "--json"])
    assert run_together([follower, Process("leader", ["--version"], leads=True)]) == 0


def test_a_failing_process_ends_the_run(tmp_path):
    """The leading program would replay for minutes. The other one fails and ends the run."""
    ports = ["--port", "0", "--control-port", "0", "--name", "leader"]
    leader = Process("leader", ["edge", "--loop", *ports], leads=True)
    assert run_together([leader, Process("failing", ["run", "--recording", "nowhere.mcap"])]) == 3


def test_failed_start_ends_the_run():
    failing = Process("failing", ["run", "--recording", "nowhere.mcap"], ready=lambda: False)
    assert run_together([failing, Process("leader", ["--version"], leads=True)]) == 3
