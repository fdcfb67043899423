"""Tests of ``enliven scan --person``: a person that turns in front of a still camera becomes a mesh with
joints.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from box_scans import run, write
from turning import TurningPerson

from enliven.errors import InputError
from enliven.formats.project.file import read_project
from enliven.meshes import extract_submesh, load_mesh
from enliven.person import Body, Joint
from enliven.possession import ActorSettings
from enliven.scanning import ScanSettings, ScanState, VolumeSettings
from enliven_edge.scanning.person import PersonScanner
from enliven_edge.stage.character_setup import create_mesh_actor

STILL, IMAGES = 5, 24
"""Number of images before the turn, and in all. The person turns 5.8 degrees per image, 104 degrees in
all.
"""
HALF = 14
"""Number of images of a person that stands still, which show one side of the body and its joints."""


def scanner():
    volume = VolumeSettings(voxel=0.012, reach=3.5, far=3.5)
    return PersonScanner(ScanSettings(volume=volume, least_depth=0.01))


@pytest.fixture(scope="module")
def scene():
    return TurningPerson(640)


@pytest.fixture(scope="module")
def images(scene):
    """Renders a person that stands still and then turns."""
    return [scene.frame(n, max(n - STILL, 0) * np.radians(5.8)) for n in range(IMAGES)]


@pytest.fixture(scope="module")
def half(scene):
    """Renders a person that stands still, with the feet below the image."""
    person_scanner = scanner()
    for n in range(HALF):
        person_scanner.add(scene.frame(n))
    return person_scanner


@pytest.fixture(scope="module")
def scanned(images):
    person_scanner = scanner()
    return person_scanner, [person_scanner.add(image).state for image in images]


@pytest.mark.slow
def test_turning_person_is_tracked_and_upright_on_the_floor(scanned, scene):
    person_scanner, states = scanned
    assert states.count(ScanState.SCANNING) >= IMAGES - 4
    turned = person_scanner.poses[-1][1][:3, :3] @ person_scanner.poses[0][1][:3, :3].T
    angle = np.degrees(np.arccos((np.trace(turned) - 1) / 2))
    assert angle == pytest.approx(5.8 * (IMAGES - 1 - STILL), abs=6.0)
    person = person_scanner.finish_person()
    low, high = person.mesh.bounds
    assert low[1] == pytest.approx(0.0, abs=1e-6) and high[1] == pytest.approx(1.73, abs=0.05)
    true, is_known = scene.joints(), np.isfinite(person.joints).all(1)
    assert is_known.sum() >= 16
    offsets = (person.joints - true)[is_known]
    # The origin of the mesh is the centre of its bounding box.
    offsets -= np.median(offsets, axis=0) * [1.0, 0.0, 1.0]
    assert np.median(np.linalg.norm(offsets, axis=1)) < 0.03 and np.linalg.norm(offsets, axis=1).max() < 0.1
    assert person_scanner.advice(IMAGES) == []


@pytest.mark.slow
def test_still_person_with_hidden_feet_reaches_the_floor(half):
    seen = half.extract_surface().vertices[:, 1].min()
    mesh = half.finish_person().mesh
    assert seen > 0.05, "the floor ends what is seen of their feet"
    for side in (-1, 1):
        foot = mesh.vertices[side * mesh.vertices[:, 0] > 0]
        assert foot[:, 1].min() == 0.0
        low = foot[foot[:, 1] < 0.02]
        # The lowest scanned part is as wide as a shin. Only the part that was completed may be below it.
        assert np.ptp(low[:, 0]) < 0.15 and np.ptp(low[:, 2]) < 0.2 and len(low) >= 5
    assert np.ptp(mesh.vertices[:, 1]) == pytest.approx(1.7, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("one_side", [False, True], ids=["turned", "half"])
def test_the_mesh_is_possessed_at_once_by_the_bones_of_the_scan(scanned, half, one_side):
    person = (half if one_side else scanned[0]).finish_person()
    actor = create_mesh_actor(person.mesh, "me", settings=ActorSettings(how="mapped"), joints=person.bones)
    # The mesh and its bones are life-size and centred on the stage.
    grown = 1.75 / np.ptp(person.mesh.vertices[:, 1])
    arms = [np.diff(of[[4, 5, 6]], axis=0) for of in (actor.likeness.joints, grown * person.joints)]
    np.testing.assert_allclose(*(np.linalg.norm(arm, axis=1) for arm in arms), rtol=1e-6)
    joints = np.where(np.isfinite(person.joints), person.joints, person.bones)
    body = Body(1, joints, np.ones(20), stature=1.75)
    raised = joints.copy()
    shoulder = joints[Joint.SHOULDER_LEFT]
    for joint in (Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT):
        away = joints[joint] - shoulder
        raised[joint] = shoulder + np.linalg.norm(away) * np.array([1.0, 0.0, 0.0])
    ends = actor.likeness.joints[[Joint.HAND_LEFT, Joint.HAND_RIGHT]]
    hands = [np.linalg.norm(actor.graph.positions - end, axis=1).argmin() for end in ends]
    back = person.mesh.vertices[:, 2].min() - person.joints[Joint.SPINE, 2]
    assert (back > -0.06) == one_side, "who holds still has no back, and their bones lie where they were seen"
    before = actor.perform([body], 0).positions[hands]
    actor.possess(body)
    for n in range(1, 40):
        after = actor.perform([replace(body, joints=raised)], n * 33_333_333).positions[hands]
    lifted = (after - before)[:, 1]
    assert lifted[0] > 0.3 and abs(lifted[1]) < 0.1, "the mesh raises its left hand as they do"


@pytest.mark.slow
def test_partial_scan_of_a_person_keeps_its_size(scanned):
    person = scanned[0].finish_person()
    high = person.mesh.vertices[person.mesh.faces, 1].min(1) > 0.8
    upper = extract_submesh(person.mesh, high)
    actor = create_mesh_actor(
        upper, "me", settings=ActorSettings(how="mapped"), fit=False, joints=person.bones
    )
    body = Body(1, person.bones, np.ones(20))
    actor.perform([body], 0)
    actor.possess(body)
    assert actor.place[0] == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_unseen_joints_are_completed_from_a_standing_person(scanned):
    person = scanned[0].finish_person()
    assert np.isfinite(person.joints[Joint.KNEE_LEFT]).all()
    hidden = person.joints.copy()
    hidden[[Joint.KNEE_LEFT, Joint.ANKLE_LEFT, Joint.FOOT_LEFT]] = np.nan
    bones = replace(person, joints=hidden).bones
    assert np.linalg.norm(bones - person.bones, axis=1).max() < 0.35 and np.isfinite(bones).all()
    assert abs(bones[Joint.FOOT_LEFT, 1] - person.bones[Joint.FOOT_RIGHT, 1]) < 0.12
    hidden[Joint.SHOULDER_CENTER] = np.nan
    assert replace(person, joints=hidden).bones.shape == (0, 3), "it is not known where its bones are"


@pytest.mark.slow
def test_the_command_writes_a_project_that_knows_its_ends(images, tmp_path):
    recording = write(images[:10], tmp_path / "me.mcap")
    output = run("--recording", recording, "-o", tmp_path / "me.enliven", "--person", "--voxel", 16)
    assert "from 10 frames" in output and "camera moved" not in output
    (character,) = read_project(tmp_path / "me.enliven").characters.values()
    assert character.ends.shape == (5, 3) and character.ends[0, 1] > 1.6 and character.ends[3:, 1].max() < 0.2
    assert character.ends[1, 0] > character.ends[2, 0], "their left is at +X, for they face +Z"
    heights = character.joints[[Joint.HEAD, Joint.HIP_CENTER, Joint.KNEE_LEFT, Joint.KNEE_RIGHT], 1]
    assert character.joints.shape == (20, 3) and (heights > [1.4, 0.8, 0.35, 0.35]).all(), "and its bones"
    run("--recording", recording, "-o", tmp_path / "me.glb", "--person", "--voxel", 16)
    assert load_mesh(tmp_path / "me.glb").mesh.bounds[1, 1] == pytest.approx(1.73, abs=0.06)


def test_recording_without_a_person_is_refused(scene, tmp_path):
    empty = write((scene.frame(n, seen=False) for n in range(6)), tmp_path / "empty.mcap")
    with pytest.raises(InputError, match=r"no person was seen.* Stand"):
        run("--recording", empty, "-o", tmp_path / "no.glb", "--person")
    with pytest.raises(InputError, match="--person and --within cannot be used together"):
        run("--recording", empty, "-o", tmp_path / "no.glb", "--person", "--within", 1.5)


@pytest.mark.slow
def test_leaving_the_view_and_moving_an_arm_are_reported(scene):
    person_scanner = scanner()
    for n in range(8):
        person_scanner.add(scene.frame(n))
    for n in range(8, 16):
        person_scanner.add(scene.frame(n, left_arm=0.35 + 0.14 * (n - 7)))
    moved = person_scanner.measure_limb_motion()
    assert list(moved) == ["left arm"] and 0.12 < moved["left arm"] < 0.9
    for n in range(16, 20):
        person_scanner.add(scene.frame(n, seen=False))
    advice = " ".join(person_scanner.advice(20))
    assert "out of view" in advice and "The left arm (by" in advice
