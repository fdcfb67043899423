"""Tests of the errors if MediaPipe cannot run in its own process. Tests with MediaPipe are in tests/real."""

import sys
from pathlib import Path

import pytest

from enliven.errors import InputError, ResourceError
from enliven_edge.landmarks import source, worker
from enliven_edge.landmarks.source import MediaPipeSettings, MediaPipeSource


def has_mediapipe() -> bool:
    import importlib.util

    return importlib.util.find_spec("mediapipe") is not None


@pytest.mark.skipif(has_mediapipe(), reason="mediapipe is here")
def test_missing_mediapipe_is_reported_with_a_fix():
    with pytest.raises(ResourceError, match=r"'mediapipe' is not installed.*extra 'colour'.*0\.10\.21"):
        MediaPipeSource()


def test_missing_mediapipe_model_is_reported_with_its_path(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "mediapipe").mkdir()
    (tmp_path / "mediapipe" / "__init__.py").touch()
    with pytest.raises(ResourceError, match=r"contains no pose model.*pose_landmarker\.task"):
        MediaPipeSettings().check()
    own = tmp_path / "state" / "enliven" / "pose_landmarker.task"
    own.parent.mkdir(parents=True)
    own.touch()
    MediaPipeSettings().check()
    assert MediaPipeSettings().model_file == own
    own.unlink()
    (tmp_path / "mediapipe" / "python" / "solutions").mkdir(parents=True)
    MediaPipeSettings().check()
    assert MediaPipeSettings().model_file is None, "an older one brings its own"


def test_a_python_that_is_not_there_is_named():
    with pytest.raises(ResourceError, match="no-such-python"):
        MediaPipeSource(MediaPipeSettings(python="/no-such-python"))


def test_a_model_that_is_not_there_is_named():
    with pytest.raises(InputError, match=r"no-model\.task"):
        MediaPipeSource(MediaPipeSettings(model="no-model.task"))


def test_the_worker_needs_nothing_of_this_program():
    """Another environment's Python runs the worker. It may import only the standard library, NumPy and
    MediaPipe.
    """
    import ast

    tree = ast.parse(Path(worker.__file__).read_text())
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add((node.module or ".").split(".")[0])
    assert names <= {*sys.stdlib_module_names, "numpy", "mediapipe"}
    siblings = {path.stem for path in Path(worker.__file__).parent.glob("*.py")}
    assert not siblings & {*sys.stdlib_module_names, "numpy", "mediapipe"}, "it runs from this folder"


def test_both_sides_agree_on_the_layout():
    assert worker.HEADER.format == source.HEADER.format
    assert len(worker.pack_people([([], [])], 1, 1)) == 4
