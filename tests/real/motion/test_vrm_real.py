"""Tests of real humanoids as VRM avatars in the T-pose, and as animations with the directions of the
performance.
"""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from enliven.document import Project
from enliven.exporters import exporter_of, sample_performance
from enliven.exporters.vrm.humanoid import humanoid_from_skeleton
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip

sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "formats"))
from strict_gltf import checked_glb
from vrm_reader import human_nodes, world_matrices

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
FILES = sorted(p for p in DATA.glob("humanoids/*") if p.suffix in (".glb", ".vrm"))

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not FILES, reason=f"no real models in {DATA} (set ENLIVEN_DATA)"),
]


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_limbs_of_a_real_humanoid_are_straight_at_rest_and_right_in_motion(path, tmp_path):
    rig = read_gltf(path)
    project, name, end = Project().with_characters(rig.shape), rig.shape.id, 0.0
    if rig.clips:
        project, shape = play_clip(Project(), rig.shape, rig.clips[0])
        name, end = shape.id, min(rig.clips[0].duration, 0.5)
    performance = sample_performance(project, name, 0.0, end, 20.0)
    bones = humanoid_from_skeleton(performance.skeleton, name).bones
    for kind, extension in (("vrm", "VRMC_vrm"), ("vrma", "VRMC_vrm_animation")):
        target = tmp_path / f"out.{kind}"
        exporter_of(target).save(target, [performance], "out")
        data = target.read_bytes()
        document = checked_glb(data)
        nodes, rest = human_nodes(document, extension), world_matrices(data)
        assert set(nodes) == set(bones)
        for side, across in (("left", 1.0), ("right", -1.0)):
            for limb, end_bone in (("UpperArm", "LowerArm"), ("LowerArm", "Hand"), ("UpperLeg", "LowerLeg")):
                start, end_node = nodes[f"{side}{limb}"], nodes[f"{side}{end_bone}"]
                along = rest[end_node, :3, 3] - rest[start, :3, 3]
                straight = np.array([0.0, -1, 0]) if "Leg" in limb else np.array([across, 0.0, 0.0])
                np.testing.assert_allclose(along / np.linalg.norm(along), straight, atol=1e-3)
                if kind == "vrm":
                    continue
                joints = (bones[f"{side}{limb}"].joint, bones[f"{side}{end_bone}"].joint)
                for key in {0, len(performance.times) - 1}:
                    way = performance.joints[key, joints[1]] - performance.joints[key, joints[0]]
                    turned = world_matrices(data, key)[start, :3, :3] @ straight
                    np.testing.assert_allclose(turned, way / np.linalg.norm(way), atol=2e-3)
