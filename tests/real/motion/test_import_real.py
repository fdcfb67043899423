"""Tests of every layout of real recordings: complete, correct sides, feet on the floor, human bones."""

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from enliven.person.joints import BONES, Joint
from enliven.recording import Recorder, Recording
from enliven.recording.depth_codec import decode_depth, encode_depth
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.registry import find_files, find_reader

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data"))
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]

DEPTH = [
    ("depth/uva_cv2_person_turn", "opencv-depth", 100, (480, 640), 525.0, 10),
    ("depth/skeltrack_kinect1", "raw-kinect1", 8, (480, 640), 525.0, 0),
    ("depth/vcl3d_realsense_d415", "realsense", 2, (360, 640), 481.94, 0),
    ("scans/tsdf_fusion_rgbd", "posed-depth", 50, (480, 640), 585.0, 5),
]
SKELETONS = [
    ("skeletons/kinect_multitrack/Study_1_*.csv", "multitrack", 362, 1),
    ("skeletons/kinect_multitrack/Study_14_*.csv", "multitrack", 22, 1),
    ("skeletons/kinect_multitrack/Study_24_*.csv", "multitrack", 533, 2),
    ("skeletons/kinect_gait/Person001_1.txt", "kinect-gait", 579, 1),
    ("skeletons/kinect_gait/Person030_2.txt", "kinect-gait", 796, 1),
    ("skeletons/js6450_kinect2_json/1person_*.json", "flow-room", 159, 1),
    ("skeletons/js6450_kinect2_json/2people_*.json", "flow-room", 120, 2),
    ("scans/bodyscanner_kinect2/*.csv", "body-scanner", 1, 1),
]
SKELETONS += [
    (f"skeletons/ms_labanotation_kinect2/{name}.csv", "labanotation", frames, 1)
    for name, frames in (("Ges01*", 154), ("Ges03*", 213), ("Ges06*", 160), ("joints", 371))
]
SKELETONS += [
    (f"skeletons/msr_action3d/{action}_s01_e01_{form}.txt", "msr-action3d", frames, 1)
    for action, frames in (("a01", 54), ("a10", 36), ("a14", 46), ("a20", 55))
    for form in ("skeleton", "skeleton3D")
]
LIMITS = {
    Joint.SPINE: (0.03, 0.5),
    Joint.SHOULDER_CENTER: (0.15, 0.5),
    Joint.HEAD: (0.1, 0.35),
    Joint.ELBOW_LEFT: (0.15, 0.4),
    Joint.ELBOW_RIGHT: (0.15, 0.4),
    Joint.WRIST_LEFT: (0.15, 0.4),
    Joint.WRIST_RIGHT: (0.15, 0.4),
    Joint.KNEE_LEFT: (0.25, 0.65),
    Joint.KNEE_RIGHT: (0.25, 0.65),
    Joint.ANKLE_LEFT: (0.25, 0.55),
    Joint.ANKLE_RIGHT: (0.25, 0.55),
}
"""Bounds of the median length in metres of the bone that ends at a joint. Some of these people are small."""


def read(pattern: str, **options):
    paths = find_files([str(DATA / pattern)])
    reader = find_reader(paths)
    return reader.name, list(reader.read(paths, ImportOptions(**options)))


@pytest.mark.parametrize(("place", "reader", "count", "shape", "focal", "coloured"), DEPTH)
def test_depth_recordings_are_imported(place, reader, count, shape, focal, coloured):
    name, frames = read(place)
    assert name == reader
    assert len(frames) == count
    assert all(frame.depth.shape == shape for frame in frames)
    assert frames[0].intrinsics.fx == pytest.approx(focal, abs=0.01)
    assert sum(frame.colour is not None for frame in frames) == coloured
    steps = np.diff([frame.time_ns for frame in frames])
    assert (steps > 0).all()
    distances = frames[0].depth[(frames[0].depth > 0) & (frames[0].depth < 65535)]
    assert 500 < np.median(distances) < 5000


def test_the_poses_of_the_hand_held_camera_are_upright():
    frames = read("scans/tsdf_fusion_rgbd")[1]
    poses = np.array([frame.world_from_camera for frame in frames])
    assert np.allclose(np.linalg.det(poses[:, :3, :3]), 1, atol=1e-3)
    assert (poses[:, 1, 1] < -0.5).all(), "the image's down is the world's down"
    assert np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).max() < 0.2


@pytest.mark.parametrize(("pattern", "reader", "count", "people"), SKELETONS)
def test_skeleton_recordings_are_imported(pattern, reader, count, people):
    name, frames = read(pattern)
    assert name == reader
    assert len(frames) == count
    assert max(len(frame.bodies) for frame in frames) == people
    assert (np.diff([frame.time_ns for frame in frames]) > 0).all()
    joints = np.array([body.joints for frame in frames for body in frame.bodies])
    confidence = np.array([body.confidence for frame in frames for body in frame.bodies])
    assert np.isfinite(joints[confidence > 0]).all()
    assert confidence.min() >= 0
    assert confidence.max() == pytest.approx(1)
    assert_on_the_floor(joints)
    assert_bones(joints)
    assert np.median(joints[:, Joint.HIP_CENTER, 2]) < -1, "the person is in front of the sensor"


CAPTURES = sorted(DATA.glob("bvh/*/*.bvh")) + sorted(DATA.glob("cmu_expmap/t*.txt"))


@pytest.mark.parametrize("path", CAPTURES, ids=lambda path: path.stem[-24:])
def test_motion_captures_are_imported(path):
    name, frames = read(str(path.relative_to(DATA)))
    assert name == "motion-capture"
    joints = np.array([frame.bodies[0].joints for frame in frames])
    assert 1.45 < frames[0].bodies[0].stature < 1.95
    assert (np.diff([frame.time_ns for frame in frames]) > 0).all()
    assert_on_the_floor(joints)
    assert_bones(joints)
    toes = (joints[:, Joint.FOOT_LEFT] - joints[:, Joint.ANKLE_LEFT]) * [1, 0, 1]
    across = joints[:, Joint.HIP_LEFT] - joints[:, Joint.HIP_RIGHT]
    ahead = np.cross(across, [0, 1, 0])
    assert np.median((toes * ahead).sum(1)) > 0, "toes point ahead, so left is left"


def assert_on_the_floor(joints):
    soles = joints[:, [Joint.FOOT_LEFT, Joint.FOOT_RIGHT, Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT], 1].min(1)
    assert -0.03 < np.median(soles) < 0.15
    assert 1.2 < np.median(joints[:, Joint.HEAD, 1]) < 1.9
    assert 0.6 < np.median(joints[:, Joint.HIP_CENTER, 1]) < 1.25


def assert_bones(joints):
    for parent, child in BONES:
        if child in LIMITS:
            length = np.median(np.linalg.norm(joints[:, child] - joints[:, parent], axis=1))
            low, high = LIMITS[Joint(child)]
            assert low < length < high, Joint(child).name


@pytest.mark.parametrize(("pattern", "reader", "count", "people"), SKELETONS)
def test_left_is_the_performers_own(pattern, reader, count, people):
    """The toes point forward. The test computes forward as the cross product of up and left, which would
    point backward for a mirrored skeleton.
    """
    if reader == "flow-room":
        pytest.skip("the depth of its feet is too coarse to tell; the next test looks at the shoulders")
    frames = read(pattern)[1]
    joints = np.array([body.joints for frame in frames for body in frame.bodies])
    left = joints[:, Joint.SHOULDER_LEFT] - joints[:, Joint.SHOULDER_RIGHT]
    toes = joints[:, Joint.FOOT_LEFT] - joints[:, Joint.ANKLE_LEFT]
    toes = toes + joints[:, Joint.FOOT_RIGHT] - joints[:, Joint.ANKLE_RIGHT]
    forward = np.cross(left, [0.0, 1.0, 0.0])
    assert np.mean(np.einsum("ij,ij->i", forward, toes) > 0) > (0.65 if reader == "kinect-gait" else 0.95)


@pytest.mark.parametrize(
    "pattern",
    [
        "skeletons/ms_labanotation_kinect2/Ges01*.csv",
        "skeletons/js6450_kinect2_json/1person_*.json",
        "skeletons/js6450_kinect2_json/2people_*.json",
        "skeletons/kinect_multitrack/Study_14_*.csv",
        "skeletons/msr_action3d/a01_s01_e01_skeleton.txt",
        "skeletons/msr_action3d/a01_s01_e01_skeleton3D.txt",
        "scans/bodyscanner_kinect2/*.csv",
    ],
)
def test_left_side_of_person_facing_the_sensor_is_at_positive_x(pattern):
    frames = read(pattern)[1]
    joints = np.array([body.joints for frame in frames for body in frame.bodies])
    across = np.median(joints[:, Joint.SHOULDER_LEFT] - joints[:, Joint.SHOULDER_RIGHT], axis=0)
    assert 0.25 < across[0] < 0.5
    assert abs(across[2]) < 0.1


@pytest.mark.parametrize(
    ("action", "limb"), [("a01", "HAND"), ("a02", "HAND"), ("a06", "HAND"), ("a14", "FOOT")]
)
def test_msr_subjects_act_with_the_right_side(action, limb):
    """The data set's authors asked for the right side, so the test shows which columns are left and right."""
    frames = read(f"skeletons/msr_action3d/{action}_s01_e01_skeleton3D.txt")[1]
    joints = np.array([frame.bodies[0].joints for frame in frames])
    moved = {side: joints[:, Joint[f"{limb}_{side}"]].std(0).sum() for side in ("LEFT", "RIGHT")}
    assert moved["RIGHT"] > 2 * moved["LEFT"]


@pytest.mark.parametrize("action", ["a01", "a06", "a16"])
def test_both_forms_of_msr_action3d_agree(action):
    forms = [
        read(f"skeletons/msr_action3d/{action}_s01_e01_{form}.txt")[1] for form in ("skeleton", "skeleton3D")
    ]
    pixels, metres = (np.array([frame.bodies[0].joints for frame in frames]) for frames in forms)
    assert np.median(np.linalg.norm(pixels - metres, axis=-1)) < 0.03


def test_the_second_kinect_of_multitrack_can_be_chosen():
    pattern = "skeletons/kinect_multitrack/Study_24_*.csv"
    first, second = read(pattern)[1], read(pattern, device="138.251.213.82")[1]
    assert first[0].sensor != second[0].sensor
    assert [sum(len(frame.bodies) for frame in frames) for frames in (first, second)] == [996, 895]


def test_the_turning_person_is_recorded_exactly_and_small(tmp_path):
    frames = read("depth/uva_cv2_person_turn")[1][::20]
    with Recorder(tmp_path / "a.mcap") as recorder:
        for frame in frames:
            recorder.write_frame(frame)
    for frame, again in zip(frames, Recording(tmp_path / "a.mcap").frames(), strict=True):
        assert np.array_equal(frame.depth, again.depth)
        assert (frame.colour is None) == (again.colour is None)
        assert frame.colour is None or np.array_equal(frame.colour, again.colour)
        assert frame.intrinsics == again.intrinsics


@pytest.mark.parametrize(("place", "fast", "small"), [("uva_cv2_person_turn", 10, 16), ("vcl3d*", 8, 12)])
def test_real_depth_shrinks(place, fast, small):
    """The raw size is divided by the encoded size, live and for archives. The slow archive mode is tested on
    every fifth image.
    """
    images = [
        np.asarray(Image.open(p)).astype(np.uint16) for p in sorted((DATA / "depth").glob(f"{place}/*.png"))
    ]
    for level, least, every in ((1, fast, 1), (19, small, 5)):
        for image in images[::every]:
            payload = encode_depth(image, level)
            assert image.nbytes > least * len(payload)
            assert np.array_equal(decode_depth(payload), image)
