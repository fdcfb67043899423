"""Tests that every entry point reads real glTF files, and files that once failed, in the same way."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from gltf_doors import READERS, STILL, measure_surface

from enliven.deformation.skinning import skin_vertices
from enliven.document import Project, character_of
from enliven.errors import InputError
from enliven.exporters.gltf.write import build_glb
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip
from enliven.meshes import load_mesh
from enliven.motion.layers.evaluate import Player
from enliven.oneshot.exportable import find_exportables

sys.path.insert(0, str(Path(__file__).parents[1] / "shared" / "formats"))
from slow_gltf import SlowGltf

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
FAULTS = DATA / "faults"
MODELS = sorted(
    path
    for folder in ("gltf/khronos", "gltf/quaternius", "gltf/quaternius_static", "humanoids")
    for path in (DATA / folder).glob("*")
    if path.suffix in (".glb", ".gltf", ".vrm")
)
FAULTY = sorted(path for path in FAULTS.glob("*.glb") if path.stem != "draco_required")
HEAVY = ("edge, by a graph", "studio", "stage", "session")
"""Entry points that do more than read. They are tested on the small files, one of each kind."""

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not MODELS, reason=f"no real models in {DATA} (set ENLIVEN_DATA)"),
]


@pytest.mark.parametrize("path", FAULTY, ids=lambda p: p.stem)
def test_every_entry_point_shows_a_faulty_file_alike(path):
    mesh = read_gltf(path).shape.mesh
    expected = measure_surface((mesh.vertices, mesh.faces))
    still = load_mesh(path).mesh
    if "mirrored" in path.stem:
        slow = SlowGltf(path).vertices_at(None, 0.0)
        np.testing.assert_allclose(still.vertices, slow, atol=1e-4)
    else:
        np.testing.assert_allclose(measure_surface((still.vertices, still.faces)), expected, rtol=2e-3)
    for name, door in READERS.items():
        wanted = measure_surface((still.vertices, still.faces)) if name in STILL else expected
        np.testing.assert_allclose(measure_surface(door(path)), wanted, rtol=2e-3, err_msg=name)


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_every_reader_shows_a_model_alike(path):
    own, loaded = read_gltf(path).shape.mesh, load_mesh(path).mesh
    used = own.vertices[np.unique(own.faces)]
    np.testing.assert_allclose(loaded.bounds, [used.min(0), used.max(0)], rtol=1e-9, atol=1e-12)
    for name, door in READERS.items():
        if name not in HEAVY:
            ours = measure_surface((own.vertices, own.faces))
            np.testing.assert_allclose(measure_surface(door(path))[:1], ours[:1], rtol=2e-3, err_msg=name)


@pytest.mark.parametrize(
    ("stem", "extent"),
    [
        ("quantised_norm", [0.4, 1.9, 0.4]),
        ("coat_in_cm", [0.36, 1.6, 0.342]),
        ("sparse", [0.74, 1.8, 0.24]),
        ("instancing", [2.24, 1.6, 0.24]),
        ("hidden_zero_scale", [0.24, 1.6, 0.24]),
        ("pop_up", [0.4, 2.0, 0.4]),
        ("joints_not_in_scene", [0.24, 1.6, 0.24]),
        ("required_KHR_lights_punctual", [0.24, 1.6, 0.24]),
    ],
)
def test_faulty_files_have_their_expected_size(stem, extent):
    for mesh in (load_mesh(FAULTS / f"{stem}.glb").mesh, read_gltf(FAULTS / f"{stem}.glb").shape.mesh):
        np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), extent, atol=2e-3)


@pytest.mark.parametrize("read", [read_gltf, load_mesh])
def test_compression_is_named(read):
    with pytest.raises(InputError, match="KHR_draco_mesh_compression"):
        read(FAULTS / "draco_required.glb")


@pytest.mark.parametrize(
    "stem", ["mirrored_joint_node", "odd_keys", "pop_up", "coat_in_cm", "hidden_zero_scale"]
)
def test_faulty_clips_move_and_are_written_as_the_format_says(stem, tmp_path):
    path = FAULTS / f"{stem}.glb"
    slow, rig = SlowGltf(path), read_gltf(path)
    for number, clip in enumerate(rig.clips):
        sampled = find_exportables(path).items[number].sample(0.0, None, None, False, True)
        (tmp_path / "again.glb").write_bytes(build_glb([sampled]))
        again = SlowGltf(tmp_path / "again.glb")
        inputs = {s["input"] for s in slow.json["animations"][number]["samplers"]}
        keys = np.unique(np.concatenate([slow.accessor(k)[:, 0] for k in inputs]))
        project, shape = play_clip(Project(), rig.shape, clip)
        for moment in np.unique(np.concatenate([keys, keys[1:] - 0.001])).tolist():
            seconds = moment - keys[0]
            expected = slow.vertices_at(number, moment)
            shown = skin_vertices(
                character_of(shape), Player(project, shape.id).compute_message_pose(seconds)
            )
            expected = expected[: len(shown)]
            np.testing.assert_allclose(shown, expected, atol=2e-3)
            np.testing.assert_allclose(again.vertices_at(0, seconds), expected, atol=2e-3)


def test_a_spike_of_20_ms_is_written(tmp_path):
    sampled = find_exportables(FAULTS / "odd_keys.glb").items[0].sample(0.0, None, None, False, True)
    (tmp_path / "again.glb").write_bytes(build_glb([sampled]))
    slow = SlowGltf(FAULTS / "odd_keys.glb")
    for seconds in (1.0, 1.01, 1.02):
        expected = slow.vertices_at(0, seconds)
        vertices = SlowGltf(tmp_path / "again.glb").vertices_at(0, seconds)
        np.testing.assert_allclose(
            [vertices.min(0), vertices.max(0)], [expected.min(0), expected.max(0)], atol=1e-4
        )
    calm, spike = (slow.vertices_at(0, seconds)[:, 0] for seconds in (1.0, 1.01))
    assert abs(spike).max() > abs(calm).max() + 0.5


def test_a_pointer_moves_its_node():
    clip = read_gltf(FAULTS / "pointer.glb").clips[0]
    assert np.abs(np.diff(clip.turns, axis=0)).max((0, 2)).astype(bool).sum() >= 2
