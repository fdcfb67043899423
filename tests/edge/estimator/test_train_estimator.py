"""Tests of `enliven train-estimator` as a user runs it: early error checks, and its output."""

from __future__ import annotations

import sys

import pytest
import typer
from typer.testing import CliRunner

from enliven.errors import InputError
from enliven_synthesis.commands.train_estimator import train_estimator

app = typer.Typer(pretty_exceptions_enable=False)
app.command()(train_estimator)


def refused(*words) -> str:
    """Returns the command's error message."""
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert isinstance(result.exception, InputError), result.output
    return str(result.exception)


@pytest.fixture
def without_torch(monkeypatch):
    """Simulates an environment without PyTorch."""
    monkeypatch.setitem(sys.modules, "torch", None)
    for name in ("network", "training"):
        monkeypatch.delitem(sys.modules, f"enliven_synthesis.training.pose_network.{name}", raising=False)


def test_an_existing_file_is_not_replaced_unasked(tmp_path):
    existing = tmp_path / "mine.onnx"
    existing.write_bytes(b"precious")
    message = refused("-o", existing)
    assert str(existing) in message and "exists already" in message and "--overwrite" in message
    assert existing.read_bytes() == b"precious"


@pytest.mark.parametrize("name", ["network", "network.npz", "network.onnx.gz"])
def test_another_kind_of_file_is_refused(tmp_path, name):
    message = refused("-o", tmp_path / name)
    assert name in message and ".onnx" in message
    assert not (tmp_path / name).exists()


def test_missing_torch_is_reported_with_the_install_command(tmp_path, without_torch):
    message = refused("-o", tmp_path / "made.onnx")
    assert "torch" in message and 'pip install "enliven-synthesis[training]"' in message
    assert not list(tmp_path.iterdir())


def test_without_torch_an_existing_file_is_kept(tmp_path, without_torch):
    there = tmp_path / "mine.onnx"
    there.write_bytes(b"precious")
    assert "torch" in refused("-o", there, "--overwrite")
    assert there.read_bytes() == b"precious"


def test_missing_output_option_is_wrong_usage():
    assert CliRunner().invoke(app, []).exit_code == 2
