"""Tests of synthetic glTF files: scenes, names, keys and URIs that the format allows or forbids."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_twins import HALF, TWINS, Twin

from enliven.errors import InputError
from enliven.formats.gltf.read import read_gltf
from enliven.meshes import load_mesh

Change = Callable[[Twin], Any]
TURN = {"node": 1, "path": "rotation"}


def clip(times: list[float], values: list[list[float]]) -> Change:
    return lambda twin: twin.channel(1, TURN, times, values)


def both(twin: Twin) -> None:
    animations = twin.json["animations"]
    animations.append(dict(animations[0]))
    for each in animations:
        each["name"] = "same"


READ: dict[str, tuple[Change, list[float]]] = {
    "no scene": (lambda t: (t.json.pop("scene"), t.json.pop("scenes")), [1.0]),
    "scene beyond the list": (lambda t: t.json.update(scene=7), [1.0]),
    "huge offset": (lambda t: t.json["nodes"][0].update(translation=[1e6, 0, -1e6]), [1.0]),
    "empty clip": (lambda t: t.json["animations"].append({"channels": [], "samplers": []}), [1.0, 0.0]),
    "one key": (clip([0.5], [HALF]), [1.0, 0.0]),
    "equal times": (clip([0, 0.5, 0.5, 1], [HALF] * 4), [1.0, 1.0]),
    "negative times": (clip([-1, 1], [HALF] * 2), [1.0, 2.0]),
    "zero turn": (clip([0, 1], [[0, 0, 0, 0], HALF]), [1.0, 1.0]),
    "same names": (both, [1.0, 1.0]),
    "same nodes' names": (lambda t: [node.update(name="joint") for node in t.json["nodes"]], [1.0]),
    "long turn": (lambda t: t.json["nodes"][1].update(rotation=[0, 0, 0, 2]), [1.0]),
    "no target": (lambda t: t.json["animations"][0]["channels"][0]["target"].pop("node"), [0.0]),
    "no indices": (lambda t: t.json["meshes"][0]["primitives"][0].pop("indices"), [1.0]),
}
"""Changes after which a file is still readable, each with the seconds of its clips."""
REFUSED: dict[str, tuple[Change, str]] = {
    "empty scene": (lambda t: t.json.update(scenes=[{"nodes": []}]), "scene of the file has no triangles"),
    "node that is not there": (lambda t: t.json["scenes"][0].update(nodes=[999]), "does not exist"),
    "no finite place": (
        lambda t: t.json["nodes"][0].update(translation=[float("nan"), 0, 0]),
        "not a finite number",
    ),
    "falling times": (clip([1, 0.5], [HALF] * 2), "not in ascending order"),
    "short matrix": (lambda t: t.json["nodes"][0].update(matrix=[1.0] * 15), "contradict each other"),
    "own child": (lambda t: t.json["nodes"][0].update(children=[0]), "has the child 0"),
    "lines": (lambda t: t.json["meshes"][0]["primitives"][0].update(mode=1), "lines or points"),
}
"""Changes after which a file cannot be read, each with words of the message."""


def changed(change: Change, path: Path) -> Path:
    twin = TWINS["waving"]()
    change(twin)
    return twin.write(path)


@pytest.mark.parametrize("kind", list(READ))
def test_an_odd_file_keeps_its_size_and_clips(tmp_path, kind):
    change, seconds = READ[kind]
    path = changed(change, tmp_path / "a.glb")
    rig = read_gltf(path)
    for mesh in (rig.shape.mesh, load_mesh(path).mesh):
        np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [0.2, 1.6, 0.2], atol=1e-3)
    assert [each.duration for each in rig.clips] == pytest.approx(seconds)
    assert len({each.id for each in rig.clips}) == len(seconds)
    assert all(np.isfinite(each.turns).all() for each in rig.clips)


@pytest.mark.parametrize("kind", list(REFUSED))
def test_invalid_file_is_refused_with_a_reason(tmp_path, kind):
    change, words = REFUSED[kind]
    path = changed(change, tmp_path / "a.glb")
    with pytest.raises(InputError, match=words) as caught:
        read_gltf(path)
    assert str(path) in caught.value.where


URIS = {
    "my data.bin": "my data.bin",
    "my%20data.bin": "my data.bin",
    "50%25.bin": "50%.bin",
    "50%.bin": "50%.bin",
    "./sub/a.bin": "sub/a.bin",
    "gr%C3%BC%C3%9Fe.bin": "grüße.bin",
}
"""URIs of a buffer, each with the file to which it refers."""


def beside(folder: Path, uri: str, name: str) -> Path:
    twin = TWINS["waving"]()
    twin.glb()
    twin.json["buffers"][0]["uri"] = uri
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(twin.blob)
    path = folder / "a.gltf"
    path.write_text(json.dumps(twin.json))
    return path


@pytest.mark.parametrize("uri", list(URIS))
def test_a_buffer_is_found_by_its_uri(tmp_path, uri):
    assert len(load_mesh(beside(tmp_path, uri, URIS[uri])).mesh.vertices) == 36


@pytest.mark.parametrize("uri", ["../a.bin", "{}/a.bin", "file://{}/a.bin", "http://example.com/a.bin"])
def test_a_buffer_elsewhere_is_not_opened(tmp_path, uri):
    (tmp_path / "in").mkdir()
    path = beside(tmp_path / "in", uri.format(tmp_path), "../a.bin")
    with pytest.raises(InputError, match=r"the referenced file '.*' (is outside|cannot be read)"):
        load_mesh(path)
