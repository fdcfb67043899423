"""Foot locking on real walks: always lets no foot slide while it stands, grounding lets none sink."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from enliven.formats.gltf import read_gltf
from enliven.mapping import automatic, retarget
from enliven.modeling.edits import lock_feet
from enliven.motion.contact.pin import held_pins, unpin
from enliven.motion.layers.evaluate import Player
from enliven.takes import read_take

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data"))
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]
WALKS = (
    "bandai_namco/dataset-1_walk_normal_001.bvh",
    "bandai_namco/dataset-1_run_normal_001.bvh",
    "xia_styles/old_13_000.bvh",
)
MODEL = "gltf/khronos/CesiumMan.glb"
SECONDS = 3.0


@pytest.mark.parametrize("walk", WALKS)
def test_a_real_walk_stands_as_its_clip_says(walk: str) -> None:
    clip, _ = read_take(DATA / "bvh" / walk, None, 0.0, SECONDS)
    shape = read_gltf(DATA / MODEL, height=1.75).shape
    made = retarget(shape, clip, replace(automatic(clip, shape), travel=True, pin=False, floor=False))
    project, name, times = unpin(made.project, made.shape_id), made.shape_id, np.arange(0.0, SECONDS, 1 / 60)
    every = range(len(project.shape(name).layers))
    free = Player(project, name).sample(times)[1]

    never = Player(lock_feet(project, name, every, "never"), name).sample(times)[1]
    np.testing.assert_allclose(never, free, atol=1e-9)

    always = lock_feet(project, name, every, "always")
    player = Player(always, name)
    joints, before, after = player.sample(times)[1], 0.0, 0.0
    for pin in held_pins(always.shape(name)):
        ankle = pin.chain[-1]
        seen = player.contacts()[always.shape(name).skeleton.names[ankle]]
        for start, end in zip(seen.starts, seen.ends, strict=True):
            inside = (start <= times) & (end >= times)
            if inside.sum() > 1:
                before = max(before, np.ptp(free[inside][:, ankle][:, [0, 2]], axis=0).max())
                after = max(after, np.ptp(joints[inside][:, ankle][:, [0, 2]], axis=0).max())
    assert before > 0.005, "it slid"
    assert after < 1e-3

    sunk = project.with_characters(project.shape(name).with_changes(place=[0.0, -0.05, 0.0]))
    ground = lock_feet(sunk, name, every, "ground")
    joints = Player(ground, name).sample(times)[1]
    for pin in held_pins(ground.shape(name)):
        assert joints[:, pin.below, 1].min() > pin.sole - 1e-5
