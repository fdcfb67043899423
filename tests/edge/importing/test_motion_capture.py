"""Tests of motion captures as bodies, with files from the synthetic performer: sizes, sides, clock, floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import typer
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from made_bvh import danced, write_bvh
from typer.testing import CliRunner

from enliven.errors import InputError
from enliven.person.joints import PARENTS, Joint
from enliven.recording import Recording
from enliven.rotation import to_matrix
from enliven_edge.commands.import_ import import_recording
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.registry import find_reader
from enliven_edge.sensors.replay import ReplaySensor


def read(path: Path, **options):
    reader = find_reader([path])
    assert reader.name == "motion-capture"
    return list(reader.read([path], ImportOptions(**options)))


LIMBS = [j for j in Joint if j not in (Joint.SPINE, Joint.SHOULDER_CENTER, Joint.HEAD)]
"""Joints that a motion capture contains exactly. The joints of the trunk are moved to where sensors report
them.
"""


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.sampled_from(["overhead", "kneel", "one leg", "chair"]),
    st.floats(1.4, 1.95),
    st.sampled_from([1.0, 0.01, 0.001, 0.0254]),
    st.booleans(),
)
def test_the_joints_are_those_of_the_person_in_metres(tmp_path, name, height, unit, z_up) -> None:
    joints = danced(name, height)
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]) if z_up else None
    frames = read(write_bvh(tmp_path / "a.bvh", joints, unit, turn))
    read_back = np.stack([frame.bodies[0].joints for frame in frames])
    moved = read_back - joints
    # The floor height may differ by the sole thickness of this performer, and by nothing else.
    assert np.ptp(moved[:, LIMBS, 1]) < 1e-5
    assert np.abs(moved[:, LIMBS, 1]).max() < 0.03
    assert np.abs(moved[:, LIMBS][..., [0, 2]]).max() < 1e-5
    assert np.abs(moved[:, [Joint.SPINE, Joint.HEAD]]).max() < 0.13
    body = frames[0].bodies[0]
    assert body.stature == pytest.approx(height, rel=0.08)
    assert (body.confidence == 1.0).all()
    assert [frame.time_ns for frame in frames[:3]] == [0, 40_000_000, 80_000_000]


def test_orientations_lie_along_the_bones(tmp_path) -> None:
    frames = read(write_bvh(tmp_path / "a.bvh", danced("chair")))
    for frame in frames[::9]:
        body = frame.bodies[0]
        turned = to_matrix(body.orientations)
        for joint in (Joint.ELBOW_LEFT, Joint.WRIST_RIGHT, Joint.KNEE_LEFT, Joint.ANKLE_RIGHT):
            bone = body.joints[joint] - body.joints[PARENTS[joint]]
            assert turned[joint, :, 1] @ bone == pytest.approx(-np.linalg.norm(bone), rel=1e-6)


def test_frame_rate_and_device_can_be_given(tmp_path) -> None:
    frames = read(write_bvh(tmp_path / "a.bvh", danced()), fps=50.0, device="studio")
    assert frames[1].time_ns == 20_000_000
    assert frames[0].sensor == "studio"


def test_imported_motion_capture_equals_the_read_frames(tmp_path) -> None:
    joints = danced("chair", seconds=1.0)
    write_bvh(tmp_path / "walk.bvh", joints)
    app = typer.Typer(pretty_exceptions_enable=False)
    app.command("import")(import_recording)
    result = CliRunner().invoke(app, [str(tmp_path / "walk.bvh"), "-o", str(tmp_path / "walk.mcap")])
    assert result.exit_code == 0, result.output
    assert f"{len(joints)} frames of bodies, 1 person" in result.output
    frames = list(Recording(tmp_path / "walk.mcap").frames())
    assert len(frames) == len(joints)
    first, replayed = read(tmp_path / "walk.bvh")[5].bodies[0], frames[5].bodies[0]
    np.testing.assert_array_equal(first.joints, replayed.joints)
    np.testing.assert_array_equal(first.orientations, replayed.orientations)
    assert first.stature == replayed.stature


def test_non_human_skeleton_error_names_missing_joints(tmp_path) -> None:
    path = write_bvh(tmp_path / "dog.bvh", danced(seconds=0.2))
    path.write_text(path.read_text().replace("Elbow", "Paw"))
    with pytest.raises(InputError, match=r"dog\.bvh: no joint is named as an elbow"):
        read(path)


def test_a_cut_off_file_names_its_line(tmp_path) -> None:
    path = write_bvh(tmp_path / "cut.bvh", danced(seconds=0.2))
    path.write_text(path.read_text()[:-40])
    with pytest.raises(InputError, match="line"):
        read(path)


def test_a_motion_capture_plays_in_place_of_a_sensor_over_and_over(tmp_path):
    path = write_bvh(tmp_path / "a.bvh", danced(seconds=1.0))
    expected = read(path)
    with ReplaySensor(path, speed=0.0, loop=True) as sensor:
        frames = [sensor.read() for _ in range(2 * len(expected))]
        converted = sensor.recording.path
    for frame, wanted in zip(frames, [*expected, *expected], strict=True):
        np.testing.assert_allclose(frame.bodies[0].joints, wanted.bodies[0].joints, atol=1e-3)
    times = [frame.time_ns for frame in frames]
    assert times == sorted(times) and not converted.exists(), "nothing is left behind"
    broken = tmp_path / "b.bvh"
    broken.write_text("HIERARCHY\nROOT nothing")
    with pytest.raises(InputError, match=r"b\.bvh"):
        ReplaySensor(broken)
