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

def write_dat(path, performances, name, digits=3):
    with open(path, "w") as file:
        for performance in performances:
            for time, places in zip(performance.times, performance.positions):
                print(performance.name, time, *places.round(digits).ravel(), sep=",", file=file)

DAT = Exporter(write_dat)
"""


@pytest.fixture
def clip():
    skeleton = Skeleton(("a", "b"), np.array([-1, 0]), np.array([[0.0, 0, 0], [0, 1, 0]]))
    still = np.tile([1.0, 0, 0, 0], (2, 2, 1))
    return Clip("still", skeleton, still, np.array([[0.0, 0, 0], [1, 0, 0]]), 0.5)


def check_dat(tmp_path, clip):
    path = tmp_path / "out.dat"
    options = {"digits": 1, "scale": 2.0}
    exporter_of(path, **options).save(path, [performance_of_clip(clip)], "title", **options)
    assert path.read_text().splitlines()[1] == "still,0.5,2.0,0.0,0.0,2.0,0.0,0.0"


def test_exporter_needs_one_file_and_one_line(tmp_path, monkeypatch, clip):
    (tmp_path / "made_dat_exporter.py").write_text(ONE_FILE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(registry.BUILT_IN_EXPORTERS, "dat", "made_dat_exporter:DAT")
    check_dat(tmp_path, clip)


def test_exporter_can_be_a_package_entry_point(tmp_path, monkeypatch, clip):
    (tmp_path / "packaged_dat_exporter.py").write_text(ONE_FILE)
    about = tmp_path / "packaged_dat_exporter-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: packaged-dat-exporter\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[enliven.exporters]\ndat = packaged_dat_exporter:DAT\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert ".dat" in suffixes()
    check_dat(tmp_path, clip)


@pytest.mark.parametrize(
    ("name", "options", "error", "words"),
    [
        ("out.fbx", {}, InputError, r"\.fbx cannot be written.*Known suffixes: \.bvh, \.csv, \.glb"),
        ("out.gltf", {}, InputError, r"\.gltf cannot be written"),
        ("out", {}, InputError, "no suffix"),
        ("out.glb", {"unit": "cm"}, InputError, "not support the option 'unit'"),
        ("out.glb", {"up": "z"}, InputError, "does not support the option 'up'.*the same vertical axis"),
        ("out.bvh", {"up": "x"}, InputError, "axis 'x' cannot be vertical. Known vertical axes: y, z"),
        ("out.bvh", {"scale": 0.0}, InputError, "the scale 0 is not allowed"),
        ("out.bvh", {"scale": float("nan")}, InputError, "the scale nan is not allowed"),
        ("out.csv", {"unit": "inch"}, InputError, "'inch' is unknown"),
        ("moveis/out.glb", {}, ResourceError, "the folder .*moveis' does not exist"),
    ],
)
def test_unwritable_export_is_refused_without_output(tmp_path, name, options, error, words):
    with pytest.raises(error, match=words):
        exporter_of(tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


def test_exporter_is_imported_lazily(tmp_path, monkeypatch):
    monkeypatch.delitem(sys.modules, "enliven.exporters.bvh")
    monkeypatch.setitem(registry.BUILT_IN_EXPORTERS, "glb", "a.module.that.is.not:there")
    exporter = exporter_of(tmp_path / "OUT.BVH", unit="cm")
    assert exporter.write.__name__ == BVH.write.__name__ and exporter.jointed and exporter.single
    with pytest.raises(ModuleNotFoundError):
        exporter_of(tmp_path / "out.glb")
