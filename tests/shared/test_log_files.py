"""Tests of log files: bounded size, limited repetition, and options at any position of the command line."""

import json
import logging
import subprocess
import sys
from pathlib import Path

import pytest

from enliven import logs
from enliven.logs import MAX_REPEATS, REPEAT_WINDOW_S, RepeatLimit, split_log_options, start_logging


@pytest.fixture
def own_loggers():
    """Restores the handlers of enliven's loggers after a test."""
    loggers = [logging.getLogger(name) for name in logs.OWN_LOGGERS]
    before = [(logger.handlers[:], logger.level, logger.propagate) for logger in loggers]
    yield
    for logger, (handlers, level, propagate) in zip(loggers, before, strict=True):
        for handler in logger.handlers:
            if handler not in handlers:
                handler.close()
        logger.handlers[:], logger.propagate = handlers, propagate
        logger.setLevel(level)
    logging.captureWarnings(False)


def test_files_are_rotated_and_their_size_is_bounded(tmp_path, own_loggers, monkeypatch) -> None:
    monkeypatch.setattr(logs, "MAX_LOG_FILE_BYTES", 4000)
    start_logging(file=tmp_path / "edge.log")
    for number in range(1000):
        logging.getLogger("enliven_edge.x").warning("line %d \x1b[31m", number)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"edge.log", *(f"edge.log.{k}" for k in range(1, logs.MAX_OLD_LOG_FILES + 1))}
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= 4000 * len(names)
    last = (tmp_path / "edge.log").read_text().splitlines()[-1]
    assert last.endswith(r"Z WARNING enliven_edge.x: line 999 \x1b[31m")


def test_file_of_json_lines_holds_no_fields_of_the_limit(tmp_path, own_loggers) -> None:
    start_logging(file=tmp_path / "edge.log", as_json=True)
    logging.getLogger("enliven_edge.x").warning("hot", extra={"celsius": 80})
    line = json.loads((tmp_path / "edge.log").read_text())
    assert set(line) == {"time", "level", "logger", "message", "celsius"}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_full_disk_loses_lines_and_raises_nothing(own_loggers, capsys) -> None:
    start_logging(file=Path("/dev/full"))
    logging.getLogger("enliven_edge.x").warning("lost")
    assert capsys.readouterr().err == ""


def test_identical_warnings_are_limited_and_counted() -> None:
    now, shown = [0.0], []
    limit = RepeatLimit(lambda: now[0])

    def tell(level: int, *message: object) -> None:
        record = logging.LogRecord("enliven", level, "", 0, message[0], message[1:], None)
        if limit.filter(record) and limit.filter(record):
            shown.append(record.getMessage())

    for _ in range(10):
        tell(logging.WARNING, "port %d is in use", 5580)
    assert shown == ["port 5580 is in use"] * MAX_REPEATS
    tell(logging.WARNING, "port %d is in use", 5582)
    for _ in range(10):
        tell(logging.INFO, "frame")
    assert shown[MAX_REPEATS:] == ["port 5582 is in use", *["frame"] * 10]
    now[0] += REPEAT_WINDOW_S
    tell(logging.WARNING, "port %d is in use", 5580)
    assert shown[-1] == f"port 5580 is in use (this message was omitted {10 - MAX_REPEATS} times)"


def test_a_warning_is_forgotten_after_256_different_ones() -> None:
    limit = RepeatLimit(lambda: 0.0)

    def passes(text: str) -> bool:
        return limit.filter(logging.LogRecord("enliven", logging.WARNING, "", 0, text, (), None))

    assert [passes("noise") for _ in range(MAX_REPEATS + 1)] == [*[True] * MAX_REPEATS, False]
    for number in range(255):
        passes(f"peer {number}")
    assert not passes("noise")
    for number in range(256):
        passes(f"peer {number}")
    assert passes("noise"), "older warnings are dropped, so that they do not fill the memory"


def test_options_are_taken_from_anywhere_before_two_dashes() -> None:
    rest, options = split_log_options(["edge", "--log-file", "a.log", "--port", "0", "--log-json"])
    assert rest == ["edge", "--port", "0"] and options.file == Path("a.log") and options.as_json
    rest, options = split_log_options(["--log-file=b.log", "edge", "--", "--log-json"])
    assert rest == ["edge", "--", "--log-json"] and options.file == Path("b.log") and not options.as_json
    with pytest.raises(ValueError, match="has no file name"):
        split_log_options(["edge", "--log-file"])


def test_program_reports_a_log_file_that_cannot_be_written(tmp_path) -> None:
    for words, code, text in (
        (["--log-file", str(tmp_path / "none" / "x.log")], 4, "cannot be written"),
        (["--log-file"], 2, "has no file name"),
        (["--log-file", str(tmp_path / "x.log")], 0, ""),
    ):
        command = [sys.executable, "-m", "enliven", "--version", *words]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=100)
        assert ended.returncode == code and text in ended.stderr, ended.stderr
