"""Real recordings in the form that the tracker receives, with the joints that come with them.

- ``bodyscanner_kinect2``: a person's scan, drawn into the depth image of its own camera (a Kinect v2 with
  known tilt). The joints of the same moment are those of the sensor's maker. Joints that do not project onto
  the scan do not count, because the feet are cut off. The right wrist and hand do not count either. The
  maker's tracker put them in front of the belly, but the scan shows this arm more than 20 cm away. Distances
  are in the image plane, because scan and joints do not match in depth. Both elbows, a wrist and a knee are
  3 to 9 cm in front of the scanned surface, and the scan leans about 7 degrees relative to the joints.
- ``js6450_kinect2``: about thirty depth samples around every joint. They are drawn as discs of 6 px, and
  eroded by half as much (morphological closing), so that gaps close and bodies do not grow. The distance to
  the sensor is not recorded. It is chosen so that people are 1.70 m tall. The sensor's height is chosen so
  that their soles are on the floor, which is not visible. A joint's depth is that of the surface in front of
  the joint, so distances are in the image plane. Only joints with measured depth count. This sequence shows
  whether a body is found in sparse depth, within a few centimetres of another tracker's result.
- ``skeltrack_kinect1``: single shots with joints marked by eye (:mod:`tracking_marks`). Distances are in the
  image plane, at the measured depth.
- ``uva_person_turn``: no joints. The score is how often the upper body's joints are within the person's mask.

In the first two recordings, SpineShoulder is used as the shoulder centre. Hip centre and spine are moved to
this project's positions on the line from SpineBase to SpineShoulder, because the maker's positions are
between the hips and on the belly. Both recordings are tracked several times, each time from a later frame.
With few samples, and with joints about 10 cm away, the score of a single run depends on its first frame.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage
from tracking_cache import Moment
from tracking_marks import MARKS
from tracking_scene import DATA
from tracking_scores import NEAR, Scores, Take, joint_label, score

from enliven.camera import Intrinsics, project, world_from_level_camera
from enliven.frames import DepthFrame
from enliven.person.body import ANKLE_ABOVE_SOLE, Body
from enliven.person.joints import Joint
from enliven_edge.importing import flow_room
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.registry import find_files, find_reader
from enliven_edge.importing.skeletons import KINECT2_NAMES
from enliven_edge.tracking.settings import SearchSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker

KINECT2 = Intrinsics(512, 424, 365.5, 365.5, 256.0, 212.0)
KINECT1 = Intrinsics(640, 480, 575.0, 575.0, 319.5, 239.5)
_STEP = 33_333_333
_STANDS_FOR, _NOISE = 60, 2.0
"""Number of frames for which the only image of a scan is shown, and the standard deviation of the noise in
each, millimetres."""
_SCAN_STARTS, _STARTS = tuple(range(0, 32, 4)), tuple(range(0, 60, 10))
"""Frames from which a scan, and the takes drawn from samples, are tracked, each time by a new tracker."""
_OFF_THE_SCAN = 0.03
_WRONGLY_GIVEN = [Joint.WRIST_RIGHT, Joint.HAND_RIGHT]
_HIP_CENTRE, _SPINE = 0.12, 0.46
"""Positions of the hip centre and the spine, as fractions of the way from between the hip joints to the
shoulder centre."""
UPPER = [Joint.HEAD, Joint.SHOULDER_LEFT, Joint.ELBOW_LEFT, Joint.SHOULDER_RIGHT, Joint.ELBOW_RIGHT]
LEGS = [j for j in Joint if j > Joint.HIP_LEFT and j != Joint.HIP_RIGHT]


@dataclass(frozen=True)
class Real:
    """A real sequence with joints. Joints and bodies are compared in the camera's frame.

    Attributes:
        plane: if not 0, joints are compared in the plane at this depth, metres.
        starts: frames from which it is tracked to its end.
    """

    name: str
    frames: list[DepthFrame]
    moments: list[Moment]
    plane: float = 0.0
    starts: tuple[int, ...] = (0,)

    def take(self, tracker: Tracker | None = None, start: int = 0) -> Take:
        """Returns the tracker's take from a frame on."""
        tracker, frames, moments = tracker or Tracker(), self.frames[start:], self.moments[start:]
        bodies = [[in_camera(b, tracker) for b in tracker.track(frame)] for frame in frames]
        times = np.array([f.time_ns * 1e-9 for f in frames])
        if self.plane:
            bodies = [[replace(b, joints=_flat(b.joints, self.plane)) for b in some] for some in bodies]
            moments = [replace(m, joints=_flat(m.joints, self.plane)) for m in moments]
        return Take(times, moments, bodies, np.ones(len(times), bool), np.zeros(len(times)))

    def scores(self) -> Scores:
        """Returns the summed scores of new trackers, one from each start."""
        total = Scores()
        for start in self.starts:
            total.add(score(self.take(start=start)))
        return total


def _flat(joints: np.ndarray, plane: float) -> np.ndarray:
    """Returns (..., 3) joints projected from the camera into the plane at depth ``plane``, metres."""
    return np.concatenate([joints[..., :2] / joints[..., 2:] * plane, np.zeros_like(joints[..., 2:])], -1)


def in_camera(body: Body, tracker: Tracker) -> Body:
    """Returns a body with its joints in the camera's frame."""
    assert tracker.world_from_camera is not None
    inverse = np.linalg.inv(tracker.world_from_camera)
    return replace(body, joints=body.joints @ inverse[:3, :3].T + inverse[:3, 3])


def with_joints() -> Iterator[Real]:
    """Yields the available sequences with joints."""
    if (DATA / "scans" / "bodyscanner_kinect2").is_dir():
        yield bodyscanner()
    for name, path in (
        ("js6450_one", "1person_lift-both-legs-separate-MIN.json"),
        ("js6450_two", "2people_raise-both-arms-MIN.json"),
    ):
        if (DATA / "skeletons" / "js6450_kinect2_json" / path).exists():
            yield js6450(name, path)


def bodyscanner() -> Real:
    """Returns one image, shown for two seconds with the noise of such a sensor."""
    folder = DATA / "scans" / "bodyscanner_kinect2"
    data = next(folder.glob("*.pcd")).read_bytes()
    points = np.frombuffer(data[data.index(b"DATA binary\n") + 12 :], "<f4").reshape(-1, 4)[:, :3]
    rows = [line.split(",") for line in next(folder.glob("2019*.csv")).read_text().split()[1:]]
    named = {name: np.array([float(x) for x in xyz]) for name, *xyz in rows}
    cv = np.array([1.0, -1.0, -1.0])
    joints = as_ours(np.array([named[name] * cv for name in KINECT2_NAMES]))
    depth = _splatted(points * cv, 1)
    plane = -float(np.median(points[:, 2]))
    flat, scan = _flat(joints, plane), _flat(points * cv, plane)
    off = np.array([np.linalg.norm(scan - joint, axis=1).min() for joint in flat])
    visible = off < _OFF_THE_SCAN
    visible[_WRONGLY_GIVEN] = False
    tilt = np.radians(named["Degree"][0])  # the sensor looks up
    mount = world_from_level_camera(_sole_below(named, tilt), -tilt)
    moment = Moment(np.ones(1, bool), joints[None], visible[None], np.zeros((1, 2), bool))
    frames = [
        DepthFrame(_noisy(depth, n), KINECT2, n * _STEP, "body scanner", world_from_camera=mount)
        for n in range(_STANDS_FOR)
    ]
    return Real("bodyscanner", frames, [moment] * len(frames), plane, _SCAN_STARTS)


def _noisy(depth: np.ndarray, seed: int) -> np.ndarray:
    """Returns the image with noise on its measured pixels."""
    noise = np.random.default_rng(seed).normal(0.0, _NOISE, depth.shape)
    return np.where(depth > 0, np.maximum(1, np.rint(depth + noise)), 0).astype(np.uint16)


def _sole_below(named: dict[str, np.ndarray], tilt: float) -> float:
    """Returns the vertical distance from the sensor down to the soles, metres, for a sensor that looks
    ``tilt`` radians up."""
    ankles = [named["AnkleLeft"], named["AnkleRight"]]
    return ANKLE_ABOVE_SOLE - min(float(p[1] * np.cos(tilt) - p[2] * np.sin(tilt)) for p in ankles)


def js6450(name: str, file: str) -> Real:
    """Returns every frame of a take, drawn from the samples around the joints."""
    path = DATA / "skeletons" / "js6450_kinect2_json" / file
    cleaned = [[flow_room.clean_joints(s) for s in frame] for frame in flow_room.read_frames(path)]
    distance = flow_room.estimate_distance([uvz for frame in cleaned for uvz, _ in frame], path)
    recorded = _json(path)
    people = sorted({s["trackingId"] for frame in recorded for s in frame})
    people = [i for i in people if sum(i == s["trackingId"] for f in recorded for s in f) > 20]
    frames, moments = [], []
    for n, (skeletons, cleaned_people) in enumerate(zip(recorded, cleaned, strict=True)):
        joints, visible = np.full((len(people), 20, 3), np.nan), np.zeros((len(people), 20), bool)
        samples = []
        for skeleton, (uvz, good) in zip(skeletons, cleaned_people, strict=True):
            if skeleton["trackingId"] not in people:
                continue
            p = people.index(skeleton["trackingId"])
            joints[p], visible[p] = as_ours(_camera_points(uvz, distance)), good
            pixels = [(q["x"], q["y"], q["z"]) for j in skeleton["joints"] for q in j["px"]]
            samples.append(_near(np.array(pixels, float), float(np.median(uvz[good, 2]))))
        points = _camera_points(np.concatenate(samples), distance) if samples else np.zeros((0, 3))
        frames.append(DepthFrame(_splatted(points, 6), KINECT2, n * _STEP, name))
        present = np.isfinite(joints).all((1, 2))
        moments.append(Moment(present, joints, visible, np.zeros((len(people), 2), bool)))
    depths = np.concatenate([m.joints[..., 2][m.visible] for m in moments])
    ankles = [m.joints[m.present][:, [Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT], 1] for m in moments]
    lowest = np.median([a.max() for a in ankles if len(a)])
    mount = world_from_level_camera(float(lowest) + ANKLE_ABOVE_SOLE, 0.0)
    frames = [replace(frame, world_from_camera=mount) for frame in frames]
    return Real(name, frames, moments, float(np.median(depths)), _STARTS)


def as_ours(joints: np.ndarray) -> np.ndarray:
    """Returns (20, 3) joints of a Kinect v2, with the hip centre and the spine at this project's
    positions."""
    base, top = joints[Joint.HIP_CENTER].copy(), joints[Joint.SHOULDER_CENTER]
    moved = joints.copy()
    for joint, part in ((Joint.HIP_CENTER, _HIP_CENTRE), (Joint.SPINE, _SPINE)):
        moved[joint] = base + part * (top - base)
    return moved


def _json(path: Path) -> list:
    return json.loads(path.read_text())


def _near(samples: np.ndarray, middle: float) -> np.ndarray:
    """Returns the samples within a metre of the body's depth. Others hit the wall behind it, or nothing."""
    apart = np.abs(samples[:, 2] - middle) * flow_room.METRES_PER_Z
    return samples[(samples[:, 2] > -499) & (apart < 1.0)]


def _camera_points(uvz: np.ndarray, distance: float) -> np.ndarray:
    """Returns (N, 3) metres, camera frame. The recorded image is mirrored: left is at its left."""
    z = distance + uvz[:, 2] * flow_room.METRES_PER_Z
    x, y = (KINECT2.cx - uvz[:, 0]) / KINECT2.fx * z, (uvz[:, 1] - KINECT2.cy) / KINECT2.fy * z
    return np.stack([x, y, z], 1)


def _splatted(points: np.ndarray, radius: int) -> np.ndarray:
    """Returns (424, 512) uint16 mm: points drawn as discs, of which the nearest is visible. Outlines are
    eroded by half a radius.
    """
    image = np.full((KINECT2.height, KINECT2.width), np.inf)
    uv = np.rint(project(points, KINECT2)).astype(int)
    for dv in range(-radius, radius + 1):
        for du in range(-radius, radius + 1):
            if du * du + dv * dv > radius * radius + 1:
                continue
            u, v = uv[:, 0] + du, uv[:, 1] + dv
            inside = (u >= 0) & (u < KINECT2.width) & (v >= 0) & (v < KINECT2.height)
            np.minimum.at(image, (v[inside], u[inside]), points[inside, 2])
    is_known = np.isfinite(image)
    if radius > 1:
        is_known = ndimage.distance_transform_edt(is_known) > 0.5 * radius
    return np.where(is_known, np.rint(1e3 * np.minimum(image, 65.0)), 0).astype(np.uint16)


_AT_ONCE = TrackerSettings(search=SearchSettings(fits_per_frame=0))
"""Tracker settings for a single frame: bodies are shown as soon as they are detected."""


def skeltrack(frames: int = 1) -> tuple[float, float, dict[str, list[Joint]]]:
    """Returns the fraction of marked joints within 10 cm in the image plane, their mean distance (mm), and
    the lost joints.

    Args:
        frames: number of repetitions of the image; 1 tests the first detection.
    """
    near, distances, lost = 0, [], {}
    for path in sorted((DATA / "depth" / "skeltrack_kinect1").glob("*.u16")):
        depth = np.fromfile(path, "<u2").reshape(480, 640)
        tracker = Tracker(_AT_ONCE)
        for n in range(frames):
            tracked = tracker.track(DepthFrame(depth, KINECT1, n * _STEP, "kinect1"))
        bodies = [in_camera(b, tracker) for b in tracked]
        number = path.stem.split("-")[-1]
        for marks in MARKS[number]:
            away = _closest(bodies, marks, depth)
            near += sum(d < NEAR for d in away.values())
            distances += list(away.values())
            lost.setdefault(number, []).extend(j for j, d in away.items() if d >= NEAR)
    return near / len(distances), 1e3 * float(np.mean(np.minimum(distances, 1.0))), lost


def _closest(bodies: list[Body], marks: dict, depth: np.ndarray) -> dict[Joint, float]:
    """Returns the distance in the image plane, metres, from each mark to the body that is nearest to all
    marks.
    """
    if not bodies:
        return {joint: np.inf for joint in marks}
    candidates = []
    for body in bodies:
        away = {}
        for joint, (u, v) in marks.items():
            around = depth[max(v - 6, 0) : v + 7, max(u - 6, 0) : u + 7]
            z = 1e-3 * float(np.median(around[around > 0])) if around.any() else 1.2
            at = project(body.joints[joint], KINECT1)
            away[joint] = float(np.linalg.norm(at - (u, v)) / KINECT1.fx * z)
        candidates.append(away)
    return min(candidates, key=lambda away: sum(away.values()))


def uva() -> tuple[float, float, list[list[Body]]]:
    """Returns the fraction of upper joints on the person (within 15 px), and the mean confidence of the legs,
    which are never visible.
    """
    paths = find_files([DATA / "depth" / "uva_cv2_person_turn"])
    tracker, inside, legs, bodies = Tracker(), [], [], []
    for n, frame in enumerate(find_reader(paths).read(paths, ImportOptions())):
        tracked = tracker.track(frame)
        bodies.append(tracked)
        mask_path = DATA / "depth" / "uva_cv2_person_turn" / f"{n:010d}_mask.jpg"
        outside = ndimage.distance_transform_edt(~(np.asarray(Image.open(mask_path).convert("L")) > 128))
        if not tracked:
            inside += [False] * len(UPPER)
            continue
        body = in_camera(tracked[0], tracker)
        uv = np.rint(project(body.joints[UPPER], frame.intrinsics)).astype(int)
        uv = np.clip(uv, 0, [outside.shape[1] - 1, outside.shape[0] - 1])
        inside += list(outside[uv[:, 1], uv[:, 0]] < 15)
        legs.append(float(tracked[0].confidence[LEGS].mean()))
    return float(np.mean(inside)), float(np.mean(legs or [0.0])), bodies


if __name__ == "__main__":
    for real in with_joints():
        s = real.scores()
        shares = s.hits / np.maximum(s.visible, 1)
        joints = " ".join(f"{joint_label(j)} {shares[j]:.2f}" for j in range(20))
        print(f"{real.name:<14} within {s.within:.3f}  mean {s.mean_mm:.0f} mm  id {s.identity}  {joints}")
    print("skeltrack     ", skeltrack(), "and after a second", skeltrack(30))
    print("uva           ", uva()[:2])
