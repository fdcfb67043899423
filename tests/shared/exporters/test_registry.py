"""Tests that exporters are found by file suffix, and that an unwritable file is refused before any work."""

import sys

import numpy as np
import pytest

from enliven.document import Clip, Skeleton
from enliven.errors import InputError, ResourceError
from enliven.exporters import exporter_of, performance_of_clip, registry, suffixes
from enliven.exporters.bvh import BVH

ONE_FILE = """
from enliven.exporters import Exporter

def write_csv(path, performances, name, digits=3):
    with open(path, "w") as file:
        for performance in performances:
            for time, places in zip(performance.times, performance.positions):
                print(performance.name, time, *places.round(digits).ravel(), sep=",", file=file)

CSV = Exporter(write_csv)
"""


@pytest.fixture
def clip():
    skeleton = Skeleton(("a", "b"), np.array([-1, 0]), np.array([[0.0, 0, 0], [0, 1, 0]]))
    still = np.tile([1.0, 0, 0, 0], (2, 2, 1))
    return Clip("still", skeleton, still, np.array([[0.0, 0, 0], [1, 0, 0]]), 0.5)


def check_csv(tmp_path, clip):
    path = tmp_path / "out.csv"
    exporter_of(path, digits=1).write(path, [performance_of_clip(clip)], "title", digits=1)
    assert path.read_text().splitlines()[1] == "still,0.5,1.0,0.0,0.0,1.0,0.0,0.0"


def test_exporter_needs_one_file_and_one_line(tmp_path, monkeypatch, clip):
    (tmp_path / "made_csv_exporter.py").write_text(ONE_FILE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(registry._BUILT_IN, "csv", "made_csv_exporter:CSV")
    check_csv(tmp_path, clip)


def test_exporter_can_be_a_package_entry_point(tmp_path, monkeypatch, clip):
    (tmp_path / "packaged_csv_exporter.py").write_text(ONE_FILE)
    about = tmp_path / "packaged_csv_exporter-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: packaged-csv-exporter\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[enliven.exporters]\ncsv = packaged_csv_exporter:CSV\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert ".csv" in suffixes()
    check_csv(tmp_path, clip)


@pytest.mark.parametrize(
    ("name", "options", "error", "words"),
    [
        ("out.fbx", {}, InputError, r"\.fbx cannot be written.*Known: \.bvh, \.glb"),
        ("out.gltf", {}, InputError, r"\.gltf cannot be written"),
        ("out", {}, InputError, "no ending"),
        ("out.glb", {"unit": "cm"}, InputError, "has no 'unit'"),
        ("moveis/out.glb", {}, ResourceError, "no folder .*moveis"),
    ],
)
def test_unwritable_export_is_refused_without_output(tmp_path, name, options, error, words):
    with pytest.raises(error, match=words):
        exporter_of(tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


def test_exporter_is_imported_lazily(tmp_path, monkeypatch):
    monkeypatch.delitem(sys.modules, "enliven.exporters.bvh")
    monkeypatch.setitem(registry._BUILT_IN, "glb", "a.module.that.is.not:there")
    exporter = exporter_of(tmp_path / "OUT.BVH", unit="cm")
    assert exporter.write.__name__ == BVH.write.__name__ and exporter.jointed and exporter.single
    with pytest.raises(ModuleNotFoundError):
        exporter_of(tmp_path / "out.glb")
