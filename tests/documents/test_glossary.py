"""Tests that docs/glossary.md is in alphabetical order, and that the names in it exist in the code."""

import ast
import re

import pytest
from blocks import ROOT

ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").splitlines()
    if re.match(r"\| \w", line)
][1:]


def defined() -> set[str]:
    """Returns the names of all top-level classes and functions of the product's modules."""
    kinds = ast.ClassDef | ast.FunctionDef
    return {
        node.name
        for package in ("shared", "edge", "viewer", "synthesis")
        for path in (ROOT / package).rglob("*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, kinds)
    }


@pytest.mark.slow
def test_every_class_in_the_glossary_exists():
    names = {name for row in ROWS for name in re.findall(r"`(\w+)`", row[2])}
    assert len(names) > 50
    assert sorted(names - defined()) == []


def test_entries_are_alphabetical_single_sentences():
    words = [row[0].lower() for row in ROWS]
    assert words == sorted(words)
    for word, sentence, _ in ROWS:
        assert re.match(r"[A-Z].+\.$", sentence), word


TERMS = {
    *("background model", "blend shape", "data association", "F-curve", "foreground", "gizmo"),
    *(
        "hole filling",
        "ICP",
        "loop closure",
        "motion trail",
        "occlusion",
        "odometry",
        "rate limit",
        "re-identification",
    ),
    *("shortcut", "SLAM", "snapshot", "TSDF"),
}
"""Standard terms of the field. A text search finds each in the glossary and in the module that implements
it.
"""


def test_standard_terms_stand_in_the_modules_that_implement_them():
    rows = {row[0]: row[2] for row in ROWS}
    assert sorted(TERMS - rows.keys()) == []
    missing = []
    for term in sorted(TERMS):
        modules = [ROOT / path for path in re.findall(r"`([\w/]+/\w+\.py)`", rows[term])]
        assert modules, f"{term}: name the module in the glossary"
        texts = [" ".join(path.read_text(encoding="utf-8").split()).lower() for path in modules]
        missing += [term] if not any(term.lower() in text for text in texts) else []
    assert missing == []
