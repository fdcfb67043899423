"""Tests that a live performer of another size moves a puppet in the same way as the performer's take."""

from __future__ import annotations

import importlib
import os
import sys
from operator import itemgetter
from pathlib import Path

import numpy as np
import pytest

from enliven.document.clip import Clip, joint_places
from enliven.example_sessions.session import read_session
from enliven.examples.puppet_motion import solve_layer_motion
from enliven.person.body import Body
from enliven_edge.stage.puppet.puppet_actor import PuppetActor
from enliven_edge.stage.puppet.settings import PuppetSettings

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
SESSIONS = Path(__file__).parents[1] / "benchmarks" / "examples" / "example_sessions"
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(
        not (DATA / "cmu_expmap").is_dir(), reason=f"no CMU motions in {DATA} (set ENLIVEN_DATA)"
    ),
]
TRACKED = (
    *("Hips", "Spine", "Neck1", "Head", "LeftArm", "LeftForeArm", "LeftHand", "LeftHandIndex1", "RightArm"),
    *("RightForeArm", "RightHand", "RightHandIndex1", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase"),
    *("RightUpLeg", "RightLeg", "RightFoot", "RightToeBase"),
)
"""The joints of CMU's performers that are most similar to the twenty of a tracked person, in the same
order.
"""
SECONDS = 6.0
sys.path.insert(0, str(SESSIONS.parent))
travel = importlib.import_module("example_travel")


def bodies_of(clip: Clip, size: float) -> list[tuple[float, Body]]:
    """Returns the performer's scaled bodies, as from a sensor at 30 frames per second, with times."""
    places = joint_places(clip)[:, [clip.skeleton.index(name) for name in TRACKED]]
    every = round(1 / 30 / clip.step)
    frames = range(0, min(len(places), round(SECONDS / clip.step)), every)
    return [(f * clip.step, Body(1, size * places[f], np.ones(20))) for f in frames]


@pytest.mark.parametrize(("mesh", "take"), [("fish", "traffic"), ("humanoid", "walks"), ("cow", "walks")])
def test_live_travel_is_that_of_the_take(mesh: str, take: str) -> None:
    """This also holds for a mesh without feet and for a performer of another size."""
    if not (DATA / travel.MESHES[mesh].file).is_file():
        pytest.skip(f"no {mesh}")
    # The first frames are a calibration pose, after which the performer turns within one frame.
    clip = travel.load_clip_by_name(take).map_values(itemgetter(slice(8, None)))
    project = travel.posed(travel.load_mesh_by_name(mesh), clip)
    puppet = project.puppet("it")
    motion = solve_layer_motion(project, puppet, 0)
    extent = float(np.linalg.norm(np.ptp(puppet.mesh.vertices, axis=0)))
    for size in (0.65, 1.0):
        actor = PuppetActor(project, puppet, PuppetSettings(fade=0.0, meet=False))
        apart = []
        for k, (seconds, body) in enumerate(bodies_of(clip, size)):
            actor.perform([body], round((seconds + 1) * 1e9))
            if k == 0:
                actor.possess(body)
            frame = max(seconds - (actor.settings.lag + 1) / actor.settings.rate, 0.0) / motion.step
            apart.append(np.linalg.norm((actor._state.root - motion.root_at(frame)[1])[[0, 2]]))
        # Both are within two leash lengths (0.06) of the same path.
        assert max(apart) < 0.12 * extent


@pytest.mark.parametrize("size", [0.65, 1.0])
@pytest.mark.parametrize(("name", "goes"), [("cactus", False), ("trex", True)])
def test_live_puppet_matches_the_take(name: str, goes: bool, size: float, monkeypatch) -> None:
    monkeypatch.setenv("ENLIVEN_DATA", str(DATA))
    session = read_session(SESSIONS / f"{name}.toml")
    puppet = session.project.puppet(session.puppet)
    actor = PuppetActor(session.project, puppet, PuppetSettings(fade=0.0, meet=False))
    take = solve_layer_motion(session.project, puppet, 0)
    extent = float(np.linalg.norm(np.ptp(puppet.mesh.vertices, axis=0)))
    apart, roots = [], []
    for k, (seconds, body) in enumerate(bodies_of(session.project.takes[puppet.layers[0].take], size)):
        actor.perform([body], round((seconds + 1) * 1e9))
        if k == 0:
            actor.possess(body)
        frame = max(seconds - (actor.settings.lag + 1) / actor.settings.rate, 0.0) / take.step
        apart.append(np.linalg.norm(actor._state.places - take.places_at(frame), axis=1))
        roots.append((actor._state.root, take.root_at(frame)[1]))
    assert np.mean(apart[10:]) < 0.02 * extent
    assert np.percentile(apart[10:], 99) < 0.10 * extent
    live, batch = (np.array(way)[[10, -1]] for way in zip(*roots, strict=True))
    gone, wanted = (float(np.linalg.norm((way[1] - way[0])[[0, 2]])) for way in (live, batch))
    assert gone == pytest.approx(wanted, rel=0.2, abs=0.05 * extent)
    assert (gone > 0.5 * extent) == goes
