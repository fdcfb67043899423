"""Tests that figures without their recordings are listed, with the public source of the data."""

from __future__ import annotations

import sys
from datetime import datetime
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import data_needs  # noqa: E402
import figures_page  # noqa: E402
from figure import Figure  # noqa: E402


def test_every_need_belongs_to_a_benchmark():
    assert data_needs.NEEDS.keys() <= {path.stem.removeprefix("bench_") for path in HERE.glob("bench_*.py")}


def test_page_lists_all_sources():
    assert data_needs.make_sources_table() in figures_page.PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize("folders", [(), ("meshes",)])
def test_missing_data_are_named(tmp_path, monkeypatch, folders):
    for folder in folders:
        (tmp_path / folder).mkdir()
    monkeypatch.setattr(data_needs, "DATA", tmp_path)
    lines = [str(need) for need in data_needs.find_missing_needs(["arap", "road", "graph"])]
    expected = ["arap", "graph"] if not folders else ["graph"]
    assert [line.partition(".")[0] for line in lines] == expected
    assert ("meshes (" in lines[-1]) is not bool(folders), "only the missing folder is named"
    assert "not measured: ENLIVEN_DATA lacks" in lines[-1] and "MB; licence:" in lines[-1]


def test_needs_stand_below_the_table(tmp_path, monkeypatch):
    monkeypatch.setattr(data_needs, "DATA", tmp_path)
    needs = data_needs.find_missing_needs(["fusion"])
    figures = [Figure("road.ms", 8.0, "ms")]
    page = "# Figures\n\n<!-- figures -->\n\nprevious table\n\n<!-- end -->\n"
    text = figures_page.make_page(page, figures, "a machine", datetime(2026, 11, 29), needs)
    assert text.index("| `road.ms` |") < text.index("This machine lacked data:")
    assert "MIT" in text and "previous table" not in text
