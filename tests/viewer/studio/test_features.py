"""Tests that a feature from another package appears in the studio's window without other changes."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from gauge_feature import SIDE, Gauge
from in_a_window import in_a_window

from enliven.errors import InputError
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.registry import ENTRY_POINTS
from enliven_viewer.studio.features.scan.session import ScanSession
from enliven_viewer.studio.workspace.workspace import Workspace

VIEWER = Path(__file__).parents[1]


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Installs the gauge as a separate package, as pip does: a module and its metadata."""
    about = tmp_path / "site" / "gauge_feature-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: gauge-feature\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[{ENTRY_POINTS}]\ngauge = gauge_feature:register\n")
    shutil.copy(VIEWER / "gauge_feature.py", tmp_path / "site")
    monkeypatch.syspath_prepend(tmp_path / "site")
    paths = [str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path for path in paths if path))


@pytest.mark.slow
def test_a_feature_of_another_package_appears_in_the_window(installed, tmp_path) -> None:
    report = in_a_window(VIEWER / "studio_feature_session.py", str(tmp_path), seconds=300.0)
    assert report["done"] and report["complaints"] == []
    assert report["before"] == [False, 0] and report["closed"] == [False, 0]
    for name in ("by menu", "Perform"):
        panel, marked = report[name]
        assert panel and marked == SIDE**2, name
    assert report["Model"] == [False, SIDE**2], "its panel is not for this workspace, its overlay is"
    assert report["tool"] == "gauge" and report["frames"]


def test_a_feature_adds_its_state_once(installed, tmp_path) -> None:
    workspace = Workspace.new(Editor(), tmp_path)
    assert workspace.actions.do("gauge.show") and workspace.state(Gauge).is_shown
    with pytest.raises(InputError, match="state Gauge: this state exists already"):
        workspace.add_state(Gauge())


def test_a_state_without_its_feature_is_reported(tmp_path) -> None:
    workspace = Workspace.new(Editor(), tmp_path)
    assert "gauge.show" not in workspace.actions
    with pytest.raises(InputError, match="state Gauge: no feature has added this state"):
        workspace.state(Gauge)


def test_an_open_panel_takes_the_place_of_its_workspace_only(tmp_path) -> None:
    workspace = Workspace.new(Editor(), tmp_path)
    usual = workspace.find_panel("Perform")
    assert usual is not None and usual.name == "perform"
    workspace.state(ScanSession).is_shown = True
    panel = workspace.find_panel("Perform")
    assert panel is not None and panel.name == "scan" and workspace.find_panel("Animate") is None
