"""Tests that docs/glossary.md is in alphabetical order and that its names exist in the code."""

import ast
import re

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


def test_every_class_that_it_names_is_there():
    names = {name for row in ROWS for name in re.findall(r"`(\w+)`", row[2])}
    assert len(names) > 50
    assert sorted(names - defined()) == []


def test_entries_are_alphabetical_single_sentences():
    words = [row[0].lower() for row in ROWS]
    assert words == sorted(words)
    for word, said, _ in ROWS:
        assert re.match(r"[A-Z].+\.$", said), word
