"""Tests that every real rig is read, evaluated, and equal to glTF's own skinning."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from enliven.deformation.skinning import skin_vertices
from enliven.document.project import Project
from enliven.document.rigged import character_of
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import build_glb
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip, weld_shape
from enliven.meshes.gltf.file import GltfFile
from enliven.meshes.gltf.motion import frame_times
from enliven.motion.layers.evaluate import Player

sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "formats"))
from slow_gltf import SlowGltf
from strict_gltf import checked_glb

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
FILES = sorted(
    p for p in (*DATA.glob("gltf/*/*"), *DATA.glob("humanoids/*")) if p.suffix in (".glb", ".gltf", ".vrm")
)
EXACT = 1e-4
"""Maximum vertex error as a fraction of the size: float32 in files and poses."""
STRAY = {"Trex": 0.1, "Spider": 3e-3}
"""Maximum errors for special rigs. One has stray weights (0.2 % of the surface) on a joint above the root.
The other has coincident joints that separate by less than a thousandth.
"""

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not FILES, reason=f"no real models in {DATA} (set ENLIVEN_DATA)"),
]


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_real_rig_moves_as_gltf_says(path):
    rig, slow, file = read_gltf(path), SlowGltf(path), GltfFile(path)
    character = character_of(rig.shape)
    size = float(np.ptp(rig.shape.mesh.vertices, axis=0).max())
    every = max(1, len(rig.shape.mesh.vertices) // 40)
    worst = 0.0
    for number, clip in list(enumerate(rig.clips))[:3]:
        project, shape = play_clip(Project(), rig.shape, clip)
        player, start = Player(project, shape.id), frame_times(file, number)[0]
        for frame in {0, len(clip.turns) // 3, len(clip.turns) - 1}:
            ours = skin_vertices(character, player.compute_message_pose(frame * clip.step))[::every]
            theirs = slow.vertices_at(number, start + frame * clip.step, every)
            worst = max(worst, float(np.linalg.norm(ours - theirs, axis=1).max()) / size)
    assert worst < STRAY.get(path.stem, EXACT)
    # Visible errors are reported.
    assert worst < 3e-3 or any("not reproduced" in note for note in rig.notes)


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_real_rig_is_written_and_read_again(path, tmp_path):
    rig = read_gltf(path)
    project, end = Project().with_characters(rig.shape), 0.0
    if rig.clips:
        project, _ = play_clip(Project(), rig.shape, rig.clips[-1])
        end = min(rig.clips[-1].duration, 0.3)
    glb = build_glb([sample_performance(project, rig.shape.id, 0.0, end)])
    checked_glb(glb)
    (tmp_path / "again.glb").write_bytes(glb)
    read = read_gltf(tmp_path / "again.glb")
    mesh = read.shape.mesh
    before, after = rig.shape.mesh.materials, mesh.materials
    if before is not None:
        assert set(before.definitions) <= set(after.definitions)
        assert [t.image.tobytes() for t in before.textures] == [t.image.tobytes() for t in after.textures]
    reread = read.shape.skeleton
    np.testing.assert_array_equal(reread.parents, rig.shape.skeleton.parents)
    size = float(np.ptp(rig.shape.mesh.vertices, axis=0).max())
    np.testing.assert_allclose(reread.positions, rig.shape.skeleton.positions, atol=1e-5 * size)
    if rig.clips and path.stem not in STRAY:
        # Its extent equals the model's. Its vertices may have a different order.
        slow, step = SlowGltf(tmp_path / "again.glb"), 0.1
        vertices = skin_vertices(
            character_of(rig.shape), Player(project, rig.shape.id).compute_message_pose(step)
        )
        low, high = vertices.min(0), vertices.max(0)
        slow_vertices = slow.vertices_at(0, step, max(1, len(mesh.vertices) // 40))
        assert (slow_vertices > low - 1e-3 * size).all() and (slow_vertices < high + 1e-3 * size).all()
        moved, shape = play_clip(Project(), read.shape, read.clips[0])
        theirs = skin_vertices(character_of(shape), Player(moved, shape.id).compute_message_pose(step))
        np.testing.assert_allclose([theirs.min(0), theirs.max(0)], [low, high], atol=1e-3 * size)


def test_a_foot_that_only_a_controller_moved_hangs_on_its_leg():
    path = next((p for p in FILES if p.stem == "Horse"), None)
    if path is None:
        pytest.skip("no horse")
    skeleton = read_gltf(path).shape.skeleton
    for side in "LR":
        chain = skeleton.path(0, skeleton.index(f"FFB.{side}"))
        assert [skeleton.names[j] for j in chain][-3:-1] == [f"BackLowerLeg.{side}", f"IKBackLeg.{side}"]


def test_flat_shaded_vertices_are_welded_on_request():
    path = next((p for p in FILES if p.stem == "Horse"), None)
    if path is None:
        pytest.skip("no horse")
    shape = read_gltf(path).shape
    joined = weld_shape(shape)
    assert len(joined.mesh.vertices) < 0.8 * len(shape.mesh.vertices)
    assert len(np.unique(joined.mesh.faces)) == len(joined.mesh.vertices)
