"""Writes the small input files that the documents name in capitals, because readers have their own."""

from __future__ import annotations

import itertools
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
from made_bodies import bvh_text, horse, man, random_motion, shape_with_markers, spider
from made_bvh import danced, write_bvh
from made_recording import write_recording
from PIL import Image
from sample_meshes.cactus import make_cactus
from sample_meshes.cactus_puppet import cactus_project
from sample_meshes.chair import make_chair
from test_handheld import box_mesh
from test_import_skeletons import labanotation_row

from enliven import cli
from enliven.document.project import Project
from enliven.document.rigged import character_of
from enliven.example_sessions.text import write_session
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import write_gltf
from enliven.formats.project.file import write_project
from enliven.formats.rig.rig import play_clip
from enliven.frames import BodyFrame, DepthFrame
from enliven.meshes.files import save_mesh
from enliven.motion.layers.evaluate import Player
from enliven.person import Body
from enliven.recording import Recorder, Recording
from enliven.rotation import from_rotation_vector, rotate
from enliven_edge.doctor import find_shipped_recording
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.scene import Box

FRAMES = 45
"""Number of frames in a recording: 1.5 s, long enough for a body to be detected and attached."""


def make_own_files(folder: Path) -> None:
    """Writes every input file that the documents name into a folder."""
    _write_meshes(folder)
    write_models(folder)
    _write_recordings(folder)
    _write_performances(folder)
    states = np.full((25, 1), 2)
    rows = [labanotation_row(89810293609 + 330000 * i, states) for i in range(FRAMES)]
    (folder / "WAVE.csv").write_text("".join(rows))


def _write_meshes(folder: Path) -> None:
    coarse = make_chair(cell=0.05)
    for name in ("HORSE.obj", "CHAIR.glb"):
        save_mesh(coarse, folder / name)
    for name in ("CACTUS.obj", "CACTUS.off", "TREE.obj"):
        save_mesh(make_cactus(cell=0.06), folder / name)
    project = cactus_project(cell=0.06)
    for name in ("SESSION.toml", "CACTUS.toml"):
        write_session(folder / name, project, "cactus")
    write_project(folder / "SHOW.enliven", project)
    write_project(folder / "SQUID.enliven", project)


def write_models(folder: Path) -> None:
    """Writes rigged models with a motion, and motion captures, into a folder."""
    frames = 8.0 * np.sin(np.arange(12)[:, None, None] + np.arange(len(man()))[None, :, None])
    for name in ("TRAFFIC.bvh",):
        (folder / name).write_text(bvh_text(man(), np.tile(frames, (1, 1, 3))))
    write_bvh(folder / "WALK.bvh", danced(seconds=2.0))
    random = np.random.default_rng(0)
    for name, skeleton in (("HORSE", horse()), ("DEER", horse()), ("FOX", horse()), ("SPIDER", spider())):
        clip = random_motion(random, skeleton, name="Run")
        project, _ = play_clip(Project(), shape_with_markers(name, skeleton), clip)
        write_gltf(folder / f"{name}.glb", [sample_performance(project, name)], "Run")


def _horse():
    """Returns a rigged horse, and a motion of the horse."""
    return shape_with_markers("horse", horse()), random_motion(np.random.default_rng(1), horse(), name="Run")


def _write_recordings(folder: Path) -> None:
    frames = [f for f in Recording(find_shipped_recording()).frames() if isinstance(f, DepthFrame)]
    for name in ("TAKE", "TWO", "WAVE"):
        with Recorder(folder / f"{name}.mcap") as recorder:
            for frame in itertools.islice(frames, FRAMES):
                recorder.write_frame(frame)
    path = HandheldPath(target=(0.0, 0.2, 0.0), radius=1.25, height=(0.8, 1.0), turns=0.3, seconds=1.2)
    box, floor = Box((-0.2, 0.0, -0.15), (0.2, 0.5, 0.15)), Box((-3.0, -0.2, -3.0), (3.0, 0.0, 3.0))
    with Recorder(folder / "CARRIED.mcap") as recorder:
        for frame in HandheldScan(box_mesh(box), load_profile("kinect1"), path, (floor,), width=320):
            recorder.write_frame(frame)
    project, shape = play_clip(Project(), *_horse())
    poses = [Player(project, "horse").compute_message_pose(k / 30) for k in range(FRAMES)]
    poses = [replace(pose, time_ns=round(k / 30 * 1e9)) for k, pose in enumerate(poses)]
    write_recording(folder / "PERFORMANCE.mcap", [(character_of(shape), poses)])
    whole = (folder / "TAKE.mcap").read_bytes()
    (folder / "BROKEN.mcap").write_bytes(whole[: 3 * len(whole) // 4])
    (folder / "MY_FRAMES").mkdir()
    for n, frame in enumerate(itertools.islice(frames, 3)):
        Image.fromarray(frame.depth).save(folder / "MY_FRAMES" / f"{n:03}.png")
    shutil.copy(folder / "MY_FRAMES" / "000.png", folder / "IMAGE.png")


def in_chair(bow: float) -> np.ndarray:
    """Returns (20, 3) joints of a person in the chair, bending forward by an angle in radians."""
    place = np.array([0.0, 0.95, 0.0])
    joints = Posture(place, standing_pose(elbow=1.5), lengths_for_height(1.75)).joints()
    turn = from_rotation_vector(np.array([bow, 0.0, 0.0]))
    joints[1:12] = rotate(turn, joints[1:12] - joints[0]) + joints[0]
    return joints


def _write_performances(folder: Path) -> None:
    """Writes bodies of a person bending forward in the chair, and an edge's recording of that chair."""
    with Recorder(folder / "BODIES.mcap") as recorder:
        for n in range(20):
            body = Body(1, in_chair(0.5 * np.sin(n / 8)), np.ones(20))
            recorder.write_frame(BodyFrame([body], round(n * 1e9 / 30), "made"))
    words = ["edge", "--recording", str(folder / "TAKE.mcap"), "--speed", "0", "--port", "0"]
    limits = ["--possess-at", "0.3", "--seconds", "0.9", "--record", str(folder / "SHOW.mcap")]
    assert cli.run([*words, *limits]) == 0
