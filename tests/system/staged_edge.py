"""An edge program that replays a performer in a loop, with a chair attached to the performer.

It prints its ports (free ones, or the given ones) and serves until SIGTERM. Then it prints the processor time
of the longest frame in milliseconds.
"""

import logging
import signal
import sys
import time
from pathlib import Path

import numpy as np

from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.recording import Recorder
from enliven.samples.shipped import load_sample
from enliven_edge.character_upload import CharacterUploads
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.replay import ReplaySensor
from enliven_edge.service import Edge
from enliven_edge.settings import EdgeSettings, WireSettings
from enliven_edge.stage.character_setup import create_mesh_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_edge.tracking.tracker import Tracker

FRAMES, STEP_NS = 60, 33_333_333


def performer(i: int) -> Body:
    """Returns a person lifting the left knee and putting it down again."""
    rotations = standing_pose(arm_forward=0.1, elbow=1.5)
    lift = 0.5 - 0.5 * np.cos(2 * np.pi * i / FRAMES)
    rotations[model.THIGH_L] = rotation(x=-lift) @ rotations[model.THIGH_L]
    rotations[model.SHIN_L] = rotation(x=lift)
    posture = Posture(np.array([0.0, 1.0, -2.5]), rotations, model.lengths_for_height(1.75))
    return Body(1, posture.joints(), np.ones(20), stature=1.75)


def main(name: str, folder: Path, rate: float, port: int = 0, control_port: int = 0) -> None:
    """Runs the edge."""
    logging.basicConfig(level=logging.WARNING)
    path = folder / "performer.mcap"
    with Recorder(path, overwrite=True) as recorder:
        for i in range(FRAMES):
            recorder.write_frame(BodyFrame([performer(i)], i * STEP_NS, "kinect2"))
    wire = WireSettings(name=name, port=port, control_port=control_port, rate=rate)
    chosen = EdgeSettings(nodes=64, wire=wire)
    actor = create_mesh_actor(load_sample("chair"), "chair", chosen.nodes, fit=False)
    actor.warm_up()
    stage = Stage([actor])
    with (
        ReplaySensor(path, loop=True) as sensor,
        Outlet(chosen.wire, sensor.name, record=folder / "take.mcap", overwrite=True) as outlet,
    ):
        edge = Edge(sensor, Tracker(), stage, outlet, possess_at=0.1, uploads=CharacterUploads(stage, chosen))
        signal.signal(signal.SIGTERM, lambda *_: edge.stop())
        step, longest = edge.step, [0.0]

        def timed(frame: BodyFrame) -> None:
            start = time.thread_time()
            step(frame)
            longest.append(time.thread_time() - start)

        edge.step = timed
        endpoint = outlet.publisher.endpoint
        print(endpoint.pose_port, endpoint.control_port, flush=True)
        edge.run()
    print(1e3 * max(longest[10:]), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), float(sys.argv[3]), *map(int, sys.argv[4:]))
