"""Tests that no frame waits for a compiler: after the warm-up, a new tracker compiles and loads no kernel."""

import subprocess
import sys

import pytest

COUNTED = """
import dataclasses, gc
import numpy as np
from numba.core.dispatcher import Dispatcher
from enliven.frames import DepthFrame
from enliven.recording import Recording
from enliven_edge.doctor import find_shipped_recording
from enliven_edge.sensors.registry import open_sensor
from enliven_edge.tracking.health.health import HealthMonitor
from enliven_edge.tracking.tracker import Tracker
from enliven_edge.warmup import warm_up_tracking

def beside(frame):
    moved = np.roll(frame.depth, frame.depth.shape[1] // 3, axis=1)
    nearer = (frame.depth == 0) | ((moved > 0) & (moved < frame.depth))
    return dataclasses.replace(frame, depth=np.where(nearer, moved, frame.depth))

def kernels():
    return {d: len(d.signatures) for d in gc.get_objects() if isinstance(d, Dispatcher)}

with open_sensor("synthetic") as sensor:
    live = [sensor.read(5.0) for _ in range(8)]
recorded = [f for f in Recording(find_shipped_recording()).frames() if isinstance(f, DepthFrame)]
cases = {
    "live": live,
    "recorded": recorded[:12],
    "later": recorded[120:132],
    "two people": [beside(f) for f in recorded[60:72]],
    "two live": [beside(f) for f in live],
    "no mounting": [dataclasses.replace(f, world_from_camera=None) for f in live],
    "nothing": [dataclasses.replace(f, depth=np.zeros_like(f.depth)) for f in live],
}
if WARM:
    warm_up_tracking()
else:
    cases = {"live": live}
for name, frames in cases.items():
    before = kernels()
    tracker, health = Tracker(), HealthMonitor()
    for frame in frames:
        health.admit(frame)
        bodies = tracker.track(frame)
        tracker.surfaces()
        health.check_result(frame, bodies, tracker.world_from_camera, tracker.state)
    print(name, *sorted({d.py_func.__name__ for d, n in kernels().items() if n > before.get(d, 0)}), sep="|")
"""
"""For each kind of frame, prints the kernels that were compiled or loaded while tracking it."""


def kernels_of(*, warm: bool) -> dict[str, list[str]]:
    """Returns the kernels that each kind of frame compiled or loaded in a separate process. Without ``warm``,
    only one kind.
    """
    command = [sys.executable, "-c", f"WARM = {warm}\n{COUNTED}"]
    shown = subprocess.run(command, capture_output=True, text=True, timeout=600, check=True)
    lines = [line.split("|") for line in shown.stdout.splitlines()]
    return {name: names for name, *names in lines}


@pytest.mark.timeout(700)
def test_warm_up_compiles_all_kernels():
    kernels = kernels_of(warm=True)
    assert len(kernels) == 7
    assert {kind: names for kind, names in kernels.items() if names} == {}


@pytest.mark.timeout(700)
@pytest.mark.slow
def test_first_frames_without_warm_up_load_kernels():
    assert {"minimise", "_solid_pixels"} <= set(kernels_of(warm=False)["live"])


SCENE = """
from enliven_edge.tracking.fit.gauss_newton import minimise
from enliven_edge.tracking.scene.background_fill import fill_from_nearest
from enliven_edge.tracking.scene.background_kernels import learn_frame
from enliven_edge.tracking.scene.floor import fit_level_plane
from enliven_edge.warmup import compile_scene_kernels
compile_scene_kernels()
print([len(kernel.signatures) for kernel in (learn_frame, fill_from_nearest, fit_level_plane, minimise)])
"""


def test_compile_scene_kernels_leaves_the_model_fit_to_the_other_process():
    shown = subprocess.run([sys.executable, "-c", SCENE], capture_output=True, text=True, check=True)
    assert shown.stdout == "[1, 1, 1, 0]\n"
