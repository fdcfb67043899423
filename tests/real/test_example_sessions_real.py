"""Tests that real meshes become puppets of real motions by the command line, and stay near their
performers.
"""

import importlib
import os
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from enliven.cli import run
from enliven.example_sessions.session import read_session
from enliven.examples.puppet_examples import examples_from_key_poses
from enliven.examples.puppet_motion import solve_layer_motion

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "examples"))
travel = importlib.import_module("example_travel")
TAKE = DATA / "cmu_expmap" / "train_directing_traffic_4.txt"
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not TAKE.exists(), reason=f"no CMU motions in {DATA} (set ENLIVEN_DATA)"),
]


@pytest.mark.parametrize(
    ("mesh", "options", "sides"),
    [
        ("cinolib/cactus.off", ["--up", "z", "--turned", "90", "--height", "1.6"], True),
        ("amxx/armadillo.off", ["--height", "1.5"], True),
        ("trex/trex_yana.obj", ["--height", "2.5"], False),
    ],
)
def test_a_session_is_suggested_posed_and_fitted(tmp_path, capsys, mesh, options, sides):
    file = DATA / "meshes" / mesh
    if not file.exists():
        pytest.skip(f"no {file}")
    session = tmp_path / "made.toml"
    window = ["--start", "1", "--end", "9", "--points", "8", "--poses", "4"]
    assert run(["examples", "new", str(file), str(TAKE), "-o", str(session), *options, *window]) == 0
    puppet = read_session(session).project.puppets[file.stem]
    assert len(puppet.poses) == 4 and len(puppet.points) >= 4
    places = {point.joint: place for point, place in zip(puppet.points, puppet.rest, strict=True)}
    if sides:
        assert places["LeftHandIndex1 end"][0] > 0.1 > -0.1 > places["RightHandIndex1 end"][0]
    # Every control point is moved slightly, each time differently.
    rng = np.random.default_rng(0)

    def moved(found):
        return f"= {[round(float(x), 3) for x in rng.normal(size=3) * 0.05]}"

    session.write_text(re.sub(r"= \[0\.0, 0\.0, 0\.0\]$", moved, session.read_text(), flags=re.MULTILINE))
    assert run(["examples", "check", str(session)]) == 0
    assert "the pose that differs most from all examples" in capsys.readouterr().out
    assert run(["examples", "fit", str(session), "-o", str(tmp_path / "made.mcap")]) == 0
    read = read_session(session)
    posed = read.project.puppets[file.stem]
    motion = solve_layer_motion(read.project, posed, 0)
    reached = examples_from_key_poses(read.project, posed).targets
    # Weights stay within bounds, so nothing moves far beyond the key poses.
    room = 1.5 * np.ptp(reached, axis=0).max() + 0.05
    assert (motion.places.min(0) > reached.min(0) - room).all()
    assert (motion.places.max(0) < reached.max(0) + room).all()
    assert np.ptp(motion.places, axis=0).max() > 0.05


def in_place(mesh, take):
    """Returns a function for a mesh and a take, or skips the test if their files are missing."""
    for file in (travel.MESHES[mesh].file, {**travel.STAYS, **travel.GOES}[take]):
        if not (DATA / file).exists():
            pytest.skip(f"no {file}")
    return travel.compute_travel(mesh, take)


@pytest.mark.parametrize("mesh", ["fish", "manta", "cow", "armadillo", "trex"])
def test_hands_that_direct_traffic_are_followed_on_both_sides(mesh):
    joints = in_place(mesh, "traffic").pairs.split(", ")
    assert {"LeftHandIndex1 end", "RightHandIndex1 end"} <= set(joints)
    if mesh in ("fish", "manta"):
        assert not any(joint.endswith("*") for joint in joints), "what swims has no feet"


@pytest.mark.parametrize(
    "mesh", ["fish", "octopus", "spider", "cow", "cactus", "humanoid", "armadillo", "trex"]
)
@pytest.mark.parametrize("take", ["traffic", "waves", "strolls", "boxes", "leaps"])
def test_puppet_is_at_its_performer_after_a_minute(mesh, take):
    travelled = in_place(mesh, take)
    assert travelled.offset < 0.2
    assert travelled.farthest < 0.2, "metres, at any time of the take"
    if take == "strolls":
        assert travelled.slide < 0.1, "centimetres a second"
