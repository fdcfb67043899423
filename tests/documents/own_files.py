"""The files in capitals that the documents' readers bring: small ones, from the project's own makers."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
from made_bodies import bvh_text, horse, man, meshed, random_motion, spider
from made_bvh import danced, write_bvh
from made_recording import write_recording
from PIL import Image
from test_import_skeletons import labanotation_row

from enliven.document.project import Project
from enliven.document.rigged import character_of
from enliven.example_sessions.text import write_session
from enliven.exporters import performance_of
from enliven.exporters.gltf import write_gltf
from enliven.formats.project.file import write_project
from enliven.formats.rig.rig import playing
from enliven.frames import DepthFrame
from enliven.meshes.files import save_mesh
from enliven.motion.layers import Player
from enliven.recording import Recorder, Recording
from enliven.samples.cactus import make_cactus
from enliven.samples.cactus_puppet import cactus_project
from enliven.samples.chair import make_chair
from enliven_edge.doctor import shipped_recording

FRAMES = 45
"""Frames of a recording, 1.5 s: a body is found in it and takes hold."""


def make_own_files(folder: Path) -> None:
    """Writes every file of one's own that a document names into a folder."""
    _write_meshes(folder)
    _write_models(folder)
    _write_recordings(folder)
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


def _write_models(folder: Path) -> None:
    frames = 8.0 * np.sin(np.arange(12)[:, None, None] + np.arange(len(man()))[None, :, None])
    for name in ("TRAFFIC.bvh",):
        (folder / name).write_text(bvh_text(man(), np.tile(frames, (1, 1, 3))))
    write_bvh(folder / "WALK.bvh", danced(seconds=2.0))
    random = np.random.default_rng(0)
    for name, skeleton in (("HORSE", horse()), ("DEER", horse()), ("FOX", horse()), ("SPIDER", spider())):
        clip = random_motion(random, skeleton, name="Run")
        project, _ = playing(Project(), meshed(name, skeleton), clip)
        write_gltf(folder / f"{name}.glb", [performance_of(project, name)], "Run")


def _horse():
    """A rigged horse, and a motion of it."""
    return meshed("horse", horse()), random_motion(np.random.default_rng(1), horse(), name="Run")


def _write_recordings(folder: Path) -> None:
    frames = [f for f in Recording(shipped_recording()).frames() if isinstance(f, DepthFrame)]
    for name in ("TAKE", "TWO", "WAVE"):
        with Recorder(folder / f"{name}.mcap") as recorder:
            for frame in itertools.islice(frames, FRAMES):
                recorder.write_frame(frame)
    project, shape = playing(Project(), *_horse())
    poses = [Player(project, "horse").pose(k / 30) for k in range(FRAMES)]
    poses = [replace(pose, time_ns=round(k / 30 * 1e9)) for k, pose in enumerate(poses)]
    write_recording(folder / "PERFORMANCE.mcap", [(character_of(shape), poses)])
    whole = (folder / "TAKE.mcap").read_bytes()
    (folder / "BROKEN.mcap").write_bytes(whole[: 3 * len(whole) // 4])
    (folder / "MY_FRAMES").mkdir()
    for n, frame in enumerate(itertools.islice(frames, 3)):
        Image.fromarray(frame.depth).save(folder / "MY_FRAMES" / f"{n:03}.png")
