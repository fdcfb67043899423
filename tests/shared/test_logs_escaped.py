"""Tests that text from outside is escaped before it is logged, printed or shown."""

from __future__ import annotations

import io
import json
import logging
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.logs import JsonLinesFormatter, SentenceFormatter, escape_records, escape_text

EVIL = {
    "terminal escape": "a\x1b[2J\x1b]0;owned\x07",
    "forged line": "a\nenliven_edge: all is well",
    "carriage return": "secret\rshown",
    "right to left": "abc\u202egpj.exe",
    "isolate": "a\u2066b\u2069",
    "zero width": "a\u200bb\ufeff",
    "line separator": "a\u2028b\u2029c\x85d",
    "c1": "a\x9b31mb",
    "delete": "a\x7f\x08b",
    "surrogate": "a\ud800b",
    "tag": "a\U000e0041b",
}
"""Names that an attacker may give a character."""
GOOD = ["chair", "Stühlchen", "椅子", "کرسی\u200cها", "👩\u200d🚀", "a b", "50 % (\u00b5m)", "back\\slash"]


def is_safe(text: str) -> bool:
    """Returns True if a terminal shows every character of a text literally, on one line."""
    kinds = {unicodedata.category(letter) for letter in text if letter not in "\u200c\u200d"}
    return not kinds & {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}


@pytest.mark.parametrize("text", GOOD)
def test_names_of_all_languages_stay_as_they_are(text: str) -> None:
    assert escape_text(text) == text


@pytest.mark.parametrize("text", EVIL.values(), ids=EVIL.keys())
def test_terminal_control_characters_are_escaped(text: str) -> None:
    shown = escape_text(text)
    assert is_safe(shown) and not is_safe(text) and "\\" in shown and shown[0] == text[0]


@given(st.text())
def test_escaped_text_is_safe_and_escaping_again_changes_nothing(text: str) -> None:
    shown = escape_text(text)
    assert is_safe(shown) and escape_text(shown) == shown
    assert shown == text or not is_safe(text)


@pytest.mark.parametrize("text", EVIL.values(), ids=EVIL.keys())
@pytest.mark.parametrize("handler", ["sentences", "json", "another program's"])
def test_log_record_is_one_safe_line(text: str, handler: str) -> None:
    escape_records()
    stream = io.StringIO()
    out = logging.StreamHandler(stream)
    out.setFormatter({"sentences": SentenceFormatter(), "json": JsonLinesFormatter()}.get(handler))
    logger = logging.getLogger("enliven_edge.a_test")
    logger.addHandler(out)
    try:
        logger.warning("%s stands on the stage", text)
    finally:
        logger.removeHandler(out)
    (line,) = stream.getvalue().removesuffix("\n").split("\n")
    assert is_safe(line) and "stands on the stage" in line
    if handler == "json":
        assert escape_text(json.loads(line)["message"]) == escape_text(f"{text} stands on the stage")


@pytest.mark.parametrize("text", EVIL.values(), ids=EVIL.keys())
def test_an_error_is_one_safe_line(text: str) -> None:
    assert is_safe(str(InputError(text, where=f"character {text}", remedy=text)))


def test_records_of_other_programs_are_left_alone() -> None:
    escape_records()
    record = logging.getLogRecordFactory()("their.logger", 20, "", 0, "two\nlines", (), None)
    assert record.getMessage() == "two\nlines"
