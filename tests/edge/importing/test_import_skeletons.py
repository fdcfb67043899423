"""Tests of the skeleton readers, each on small files that the test writes in the reader's layout."""

import json
from pathlib import Path

import numpy as np
import pytest

from enliven.errors import InputError
from enliven.person.body import ANKLE_ABOVE_SOLE, Body
from enliven.person.joints import Joint
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.kinect_texts import MSR_FOCAL, MSR_ORDER, level_from_tilted
from enliven_edge.importing.mirror import OTHER_SIDE, mirror_frames
from enliven_edge.importing.registry import find_reader
from enliven_edge.importing.skeletons import (
    KINECT2_NAMES,
    KINECT2_ORDER,
    WORLD_FROM_KINECT_SPACE,
    SkeletonMoment,
    frames_in_world,
)
from enliven_edge.tracking.output.output import Output

UPRIGHT = {
    "HIP_CENTER": (0, 0.95, 0),
    "SPINE": (0, 1.15, 0),
    "SHOULDER_CENTER": (0, 1.45, 0),
    "HEAD": (0, 1.65, 0),
    "SHOULDER_LEFT": (0.2, 1.4, 0),
    "ELBOW_LEFT": (0.25, 1.1, 0.02),
    "WRIST_LEFT": (0.27, 0.9, 0.1),
    "HAND_LEFT": (0.27, 0.82, 0.12),
    "HIP_LEFT": (0.1, 0.9, 0),
    "KNEE_LEFT": (0.11, 0.5, 0.02),
    "ANKLE_LEFT": (0.12, 0.08, 0),
    "FOOT_LEFT": (0.12, 0.03, 0.15),
}
"""A standing person facing the sensor (along +Z of the world, left hand at +X)."""


def person(across: float = 0.0, away: float = 2.5, raised: float = 0.0) -> np.ndarray:
    """Returns (20, 3) joints in the world, metres. The right hand is ``raised`` by this height."""
    joints = np.zeros((20, 3))
    for joint in Joint:
        side = -1 if "RIGHT" in joint.name else 1
        x, y, z = UPRIGHT[joint.name.replace("RIGHT", "LEFT")]
        joints[joint] = (side * x + across, y, z - away)
    joints[Joint.HAND_RIGHT, 1] += raised
    return joints


def kinect_space(world: np.ndarray, sensor_height: float = 1.1) -> np.ndarray:
    """Returns world joints in the frame of a level Kinect: +X to its left, +Y up, +Z away from it."""
    return (world - [0, sensor_height, 0]) * [-1, 1, -1]


def kinect2_joints(world: np.ndarray) -> np.ndarray:
    """Returns (25, 3) joints of Kinect SDK 2; 20 of them are the joints of ``world``."""
    joints = np.zeros((25, 3))
    joints[list(KINECT2_ORDER)] = kinect_space(world)
    return joints


def read(path: Path, **options):
    reader = find_reader([path])
    return reader.name, list(reader.read([path], ImportOptions(**options)))


def assert_person(body, expected: np.ndarray, tolerance: float = 1e-5) -> None:
    assert np.allclose(body.joints, expected, atol=tolerance)
    facing = np.cross(body.joints[Joint.SHOULDER_LEFT] - body.joints[Joint.SHOULDER_RIGHT], [0, 1, 0])
    toes = body.joints[Joint.FOOT_LEFT] - body.joints[Joint.ANKLE_LEFT]
    assert facing @ toes > 0


def labanotation_row(ticks: int, states: np.ndarray) -> str:
    values = np.hstack([kinect2_joints(person()), states])
    return f"{ticks}," + ",".join(map(str, values.ravel())) + ",\n"


def test_labanotation_is_read(tmp_path):
    states = np.full((25, 1), 2)
    states[KINECT2_ORDER[Joint.HAND_LEFT]] = 1
    states[KINECT2_ORDER[Joint.FOOT_LEFT]] = 0
    rows = [labanotation_row(89810293609 + 330000 * i, states) for i in range(3)]
    path = tmp_path / "wave.csv"
    path.write_text("".join(rows))
    name, frames = read(path)
    assert name == "labanotation"
    assert [frame.time_ns for frame in frames] == [(89810293609 + 330000 * i) * 100 for i in range(3)]
    assert_person(frames[1].bodies[0], person())
    confidence = frames[1].bodies[0].confidence
    assert confidence[Joint.HAND_LEFT] == pytest.approx(0.4)
    assert confidence[Joint.FOOT_LEFT] == 0
    assert confidence[Joint.HEAD] == 1


MULTI_KEYS = "Study_Id, Kinect_Config, Scenario_Id, Tracker_Time, Person_Id, Skeleton_Id, Kinect_Id"


def multitrack_file(path: Path, rows: list[tuple[int, int, str, np.ndarray]]) -> Path:
    names = sorted(KINECT2_NAMES)
    header = MULTI_KEYS + "".join(f", {name}_{axis}" for name in names for axis in "XYZ")
    lines = [header]
    for time_ms, who, kinect, world in rows:
        space = dict(zip(KINECT2_NAMES, kinect_space(world), strict=True))
        cells = [3, 2, 1, time_ms, who, 0, kinect, *np.concatenate([space[name] for name in names])]
        lines.append(", ".join(map(str, cells)))
    path.write_text("\n".join(lines) + "\n")
    return path


def test_multitrack_reads_one_kinect_with_two_people(tmp_path):
    start = 63562211573869
    rows = [
        (start, 0, "10.0.0.1", person(-0.5)),
        (start, 0, "10.0.0.2", person(9)),
        (start, 1, "10.0.0.1", person(0.6)),
        (start + 35, 0, "10.0.0.1", person(-0.4)),
    ]
    name, frames = read(multitrack_file(tmp_path / "a.csv", rows))
    assert name == "multitrack"
    assert [(f.time_ns, [b.id for b in f.bodies], f.sensor) for f in frames] == [
        (0, [0, 1], "kinect2-10.0.0.1"),
        (35_000_000, [0], "kinect2-10.0.0.1"),
    ]
    assert_person(frames[0].bodies[0], person(-0.5))
    assert_person(frames[0].bodies[1], person(0.6))


def test_multitrack_takes_the_kinect_that_is_named(tmp_path):
    rows = [(1, 0, "a", person()), (2, 0, "a", person()), (1, 0, "b", person(0.7))]
    path = multitrack_file(tmp_path / "a.csv", rows)
    assert [len(frame.bodies) for frame in read(path)[1]] == [1, 1]
    frames = read(path, device="b")[1]
    assert [len(frame.bodies) for frame in frames] == [1, 0]
    assert_person(frames[0].bodies[0], person(0.7))
    with pytest.raises(InputError, match="Kinects in the file: a, b"):
        read(path, device="c")


def msr_rows(world: np.ndarray, pixels: bool) -> str:
    space = kinect_space(world)[list(MSR_ORDER)]
    confidence = np.where(np.array(MSR_ORDER) == Joint.FOOT_LEFT, 0.0, 0.75)
    if pixels:
        x, y, z = space.T
        space = np.stack([160 + MSR_FOCAL * x / z, 120 - MSR_FOCAL * y / z, z / 0.004], -1)
    return (
        "\n".join("  ".join(f"{v:.7e}" for v in row) for row in np.column_stack([space, confidence])) + "\n"
    )


@pytest.mark.parametrize("pixels", [False, True], ids=["metres", "pixels"])
def test_msr_action3d_is_read(tmp_path, pixels):
    path = tmp_path / "a01.txt"
    path.write_text("".join(msr_rows(person(raised=0.1 * i), pixels) for i in range(4)))
    name, frames = read(path)
    assert name == "msr-action3d"
    assert [frame.time_ns for frame in frames] == [round(i / 15 * 1e9) for i in range(4)]
    for i, frame in enumerate(frames):
        expected = person(raised=0.1 * i)
        assert_person(frame.bodies[0], expected - [0, frame_floor(expected), 0], 1e-4)
    assert frames[0].bodies[0].confidence[Joint.FOOT_LEFT] == 0
    assert frames[0].bodies[0].confidence[Joint.HEAD] == pytest.approx(0.75)


def frame_floor(world: np.ndarray) -> float:
    """Returns the estimated floor height of a frame in which the left foot is not visible."""
    soles = [world[Joint.FOOT_RIGHT, 1] - 0.02]
    soles += [world[j, 1] - ANKLE_ABOVE_SOLE for j in (Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT)]
    return min(soles)


def gait_text(world: np.ndarray, order: list[Joint]) -> str:
    lines = []
    for joint in order:
        name = joint.name.replace("_", "-").title().replace("Hip-Center", "Hip-centro")
        lines.append(name + ";" + ";".join(map(str, kinect_space(world)[joint])))
    return "\n".join(lines) + "\n"


def test_gait_recording_is_read(tmp_path):
    order = [Joint.HEAD, *(joint for joint in Joint if joint != Joint.HEAD)]
    path = tmp_path / "walk.txt"
    text = "".join(gait_text(person(), order) for _ in range(3))
    path.write_text(text + gait_text(person(), order)[:200].rsplit("\n", 1)[0] + "\n")
    name, frames = read(path, fps=10)
    assert name == "kinect-gait"
    assert [frame.time_ns for frame in frames] == [0, 100_000_000, 200_000_000, 300_000_000]
    assert_person(frames[2].bodies[0], person())
    missing = frames[3].bodies[0].confidence == 0
    assert missing.any()
    assert np.isnan(frames[3].bodies[0].joints[missing]).all()
    assert np.isfinite(frames[3].bodies[0].joints[~missing]).all()
    assert (frames[2].bodies[0].confidence == 1).all()


def test_missing_joint_keeps_its_position_without_effect(tmp_path):
    order = [Joint.HEAD, *(joint for joint in Joint if joint != Joint.HEAD)]
    path = tmp_path / "walk.txt"
    whole = gait_text(person(), order)
    without = "".join(line + "\n" for line in whole.splitlines() if not line.startswith("Hand-Left"))
    path.write_text(whole + without + gait_text(person(0.03), order))
    frames = read(path)[1]
    # The edge does this with every body of a sensor or a recording.
    output = Output()
    shown = [output(frame.bodies, frame.time_ns)[0] for frame in frames]
    assert np.allclose(shown[1].joints[Joint.HAND_LEFT], person()[Joint.HAND_LEFT], atol=1e-6)
    assert [body.confidence[Joint.HAND_LEFT] for body in shown] == [1, 0, 1]


def test_everybody_has_the_stature_of_their_bones_over_the_take(tmp_path):
    rng = np.random.default_rng(0)
    rows = [
        (40 * i, who, "a", tall * person(0.9 * who) + rng.normal(0, 0.01, (20, 3)))
        for i in range(60)
        for who, tall in ((0, 1.0), (1, 0.8))
    ]
    frames = read(multitrack_file(tmp_path / "a.csv", rows))[1]
    statures = {body.id: body.stature for frame in frames for body in frame.bodies}
    assert statures[0] == pytest.approx(1.80, abs=0.05)
    assert statures[1] == pytest.approx(0.8 * (1.80 - 0.2) + 0.2, abs=0.05)


def flow_room_body(world: np.ndarray, who: str, origin: float) -> dict:
    """A body in depth pixels, z in millimetres beyond ``origin`` metres."""
    joints = np.zeros((25, 3))
    joints[list(KINECT2_ORDER)] = kinect_space(world)
    joints[2] = joints[3]
    x, y, z = joints[:21].T
    points = np.stack([256 + 365.5 * x / z, 212 - 365.5 * y / z, 1000 * (z - origin)], -1)
    listed = [{"x": u, "y": v, "z": w, "px": []} for u, v, w in points.tolist()]
    return {"bodyIndex": 0, "trackingId": who, "leftHandState": 0, "rightHandState": 1, "joints": listed}


def test_flow_room_sets_the_distance_by_the_stature(tmp_path):
    frame = [flow_room_body(person(0.4), "720", 2.4), flow_room_body(person(-0.6), "721", 2.4)]
    frame[0]["joints"][7]["z"] = -500
    path = tmp_path / "two.json"
    path.write_text(json.dumps([frame, frame[:1], frame[1:]]))
    name, frames = read(path)
    assert name == "flow-room"
    assert [[body.id for body in f.bodies] for f in frames] == [[0, 1], [0], [1]]
    left, right = frames[0].bodies
    height = left.joints[Joint.HEAD, 1] - left.joints[Joint.ANKLE_LEFT, 1]
    assert height == pytest.approx(0.88 * 1.70, rel=0.02)
    scale = height / (UPRIGHT["HEAD"][1] - UPRIGHT["ANKLE_LEFT"][1])
    for body, across in ((left, 0.4), (right, -0.6)):
        hip = body.joints[Joint.HIP_CENTER]
        assert hip[0] == pytest.approx(across * scale, abs=0.03)
        assert body.joints[Joint.SHOULDER_LEFT, 0] > body.joints[Joint.SHOULDER_RIGHT, 0]
        assert hip[2] == pytest.approx(-2.5 * scale, abs=0.05)
    assert left.confidence[Joint.HAND_LEFT] < 0.5
    assert right.confidence[Joint.HAND_LEFT] == 1


def scanner_text(world: np.ndarray, degrees: float) -> str:
    """Returns a file with the joints in the frame of a sensor that looks down. Levelling restores the world
    joints.
    """
    tilted = (world - [0, 1.1, 0]) @ level_from_tilted(np.radians(degrees))
    lines = ["Joints,X,Y,Z", f"Degree,{degrees},{degrees},{degrees}"]
    lines += [name + "," + ",".join(map(str, xyz)) for name, xyz in zip(KINECT2_NAMES, tilted, strict=True)]
    return "\n".join([*lines, "Neck,0,0,0", "ThumbLeft,0,0,0"]) + "\n"


def test_body_scanner_is_levelled(tmp_path):
    path = tmp_path / "20190823.csv"
    path.write_text(scanner_text(person(), 13.5))
    name, frames = read(path)
    assert name == "body-scanner"
    assert len(frames) == 1
    assert_person(frames[0].bodies[0], person())


@pytest.mark.parametrize("degrees", [np.inf, -np.inf, np.nan])
def test_body_scanner_without_a_finite_tilt_is_refused(tmp_path, degrees):
    path = tmp_path / "20190823.csv"
    path.write_text(scanner_text(person(), 0.0).replace("Degree,0.0", f"Degree,{degrees}"))
    with pytest.raises(InputError, match="the row Degree has no finite number of degrees"):
        read(path)


def test_levelling_is_the_formula_of_the_data_set():
    tilt = np.radians(13.53401)
    x, y, z = 0.3, -0.7, -2.2
    levelled = level_from_tilted(tilt) @ [x, y, z]
    expected = [x, y * np.cos(tilt) - z * np.sin(tilt), y * np.sin(tilt) + z * np.cos(tilt)]
    assert np.allclose(levelled, expected)


def test_a_jump_does_not_move_the_floor(tmp_path):
    order = [Joint.HEAD, *(joint for joint in Joint if joint != Joint.HEAD)]
    path = tmp_path / "jump.txt"
    heights = [0, 0, 0, 0.3, 0.5, 0.3, 0, 0, -0.4, 0]
    path.write_text("".join(gait_text(person() + np.array([0, h, 0]), order) for h in heights))
    frames = read(path)[1]
    for frame, height in zip(frames, heights, strict=True):
        assert_person(frame.bodies[0], person() + np.array([0, height, 0]))


def test_mirroring_swaps_sides(tmp_path):
    path = tmp_path / "a01.txt"
    path.write_text(msr_rows(person(raised=0.5), False))
    (frame,) = mirror_frames(iter(read(path)[1]))
    joints = frame.bodies[0].joints
    assert joints[Joint.HAND_LEFT, 1] > joints[Joint.HAND_RIGHT, 1] + 0.4
    assert joints[Joint.SHOULDER_LEFT, 0] > joints[Joint.SHOULDER_RIGHT, 0]
    assert frame.bodies[0].stature is not None
    assert [OTHER_SIDE[side] for side in OTHER_SIDE] == list(Joint)


@pytest.mark.parametrize(
    ("name", "damage", "expected"),
    [
        ("wave.csv", lambda text: text.replace(",2.0,", ",7.0,", 40), "tracking state"),
        ("wave.csv", lambda text: text.replace("\n", "\n1,2,3,\n", 1), "line 2 has 3 values"),
    ],
)
def test_damaged_labanotation_is_reported_with_the_place(tmp_path, name, damage, expected):
    row = labanotation_row(5, np.full((25, 1), 2))
    path = tmp_path / name
    path.write_text(damage(row * 3))
    reader = find_reader([path], "labanotation")
    with pytest.raises(InputError, match=expected) as caught:
        list(reader.read([path]))
    assert str(path) in str(caught.value)


def test_damaged_skeleton_files_are_reported_with_the_place(tmp_path):
    cases = {
        "msr-action3d": (msr_rows(person(), False)[:-60], "not a multiple of 80"),
        "kinect-gait": ("Head;0;1;2\nTail;0;1;2\n", "line 2 names the unknown joint 'Tail'"),
        "flow-room": ('[[{"bodyIndex":0,"joints":[{"x":1,"y":2,"z":3}]}]]', "a body with 1 joints"),
        "body-scanner": ("Joints,X,Y,Z\nDegree,1,1,1\nHead,0,1,2\n", "the row SpineBase is missing"),
        "multitrack": (MULTI_KEYS + ", SpineBase_X\n", "column SpineBase_Y is missing"),
        "labanotation": ("", "empty"),
    }
    for name, (text, expected) in cases.items():
        path = tmp_path / f"{name}.txt"
        path.write_text(text)
        with pytest.raises(InputError, match=expected) as caught:
            list(find_reader([path], name).read([path]))
        assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (", a, ", ", ", "line 3 has 66 values, expected 67"),
        ("1, 40, 0, 0, a", "1, , 0, 0, a", "no time or no person"),
        ("1, 40, 0, 0, a", "1, 40, nan, 0, a", "no time or no person"),
    ],
)
def test_multitrack_with_an_incomplete_row_is_refused(tmp_path, old, new, expected):
    path = multitrack_file(tmp_path / "a.csv", [(40 * k, 0, "a", person()) for k in range(3)])
    header, first, second, last = path.read_text().splitlines()
    path.write_text("\n".join([header, first, second.replace(old, new, 1), last]) + "\n")
    with pytest.raises(InputError, match=expected):
        read(path)


def test_flow_room_text_that_is_not_utf_8_is_refused(tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(b'[[{"trackingId":"\xff","joints":[]}]]')
    with pytest.raises(InputError, match="damaged or of another kind"):
        list(find_reader([path], "flow-room").read([path]))


def test_flow_room_joint_at_an_impossible_position_is_refused(tmp_path):
    frame = [flow_room_body(person(), "720", 2.4)]
    frame[0]["joints"][7]["z"] = 1e308
    path = tmp_path / "a.json"
    path.write_text(json.dumps([frame]))
    with pytest.raises(InputError, match="frame 0 has a joint at an impossible position"):
        read(path)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [1e308, -1e200, 2000.0, np.inf, np.nan])
def test_joint_at_an_impossible_position_is_missing(value):
    joints = person()
    good = Body(0, joints, np.ones(20))
    bad = Body(0, joints.copy(), np.ones(20))
    bad.joints[Joint.HAND_LEFT, 2] = value
    moments = [SkeletonMoment(0, [good]), SkeletonMoment(33_000_000, [bad])]
    first, second = frames_in_world(moments, "kinect1", WORLD_FROM_KINECT_SPACE, "take")
    (good,), (bad,) = first.bodies, second.bodies
    others = np.arange(20) != Joint.HAND_LEFT
    assert np.isnan(bad.joints[Joint.HAND_LEFT]).all() and bad.confidence[Joint.HAND_LEFT] == 0.0
    assert np.array_equal(bad.joints[others], good.joints[others]) and bad.stature == good.stature


def test_recording_without_upright_person_is_reported(tmp_path):
    path = tmp_path / "a.json"
    joints = ",".join(['{"x":-500,"y":-500,"z":-500}'] * 21)
    path.write_text('[[],[{"bodyIndex":0,"joints":[' + joints + "]}]]")
    with pytest.raises(InputError, match="no person who stands upright"):
        list(find_reader([path], "flow-room").read([path]))


def test_several_recordings_are_not_mixed(tmp_path):
    paths = []
    for name in "abcdef":
        paths.append(tmp_path / f"{name}.txt")
        paths[-1].write_text(msr_rows(person(), False))
    with pytest.raises(
        InputError, match=r"the 6 files are separate recordings \(a.txt, b.txt, c.txt, d.txt, ...\)"
    ):
        list(find_reader(paths).read(paths))
