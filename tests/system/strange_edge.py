"""An edge program in its own process, for tests that may crash it.

It replays a small recording in a loop and offers one large character. It prints its ports and serves until
SIGTERM.
"""

import logging
import signal
import sys
import tempfile
from pathlib import Path

import numpy as np

from enliven.document.character import Character, SkinWeights
from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.person.joints import J
from enliven.recording import Recorder
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.replay import ReplaySensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker

FRAMES, STEP_NS = 30, 33_333_333
VERTICES = 60_000


def statue() -> Character:
    """Returns a character of 60,000 vertices, over a megabyte on the wire."""
    random = np.random.default_rng(0)
    vertices = random.normal(size=(VERTICES, 3)).astype(np.float32)
    faces = random.integers(0, VERTICES, (VERTICES, 3)).astype(np.int32)
    skin = SkinWeights(np.zeros((VERTICES, 4), np.uint16), np.full((VERTICES, 4), 0.25, np.float32))
    return Character("statue", vertices, faces, skin, vertices[:8], np.zeros((0, 2), np.int32))


def main(name: str) -> None:
    """Runs the edge."""
    logging.basicConfig(level=logging.WARNING)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "second.mcap"
        with Recorder(path) as recorder:
            for i in range(FRAMES):
                body = Body(0, np.full((J, 3), 0.01 * i), np.ones(J))
                recorder.write_frame(BodyFrame([body], i * STEP_NS, "kinect2"))
        wire = WireSettings(name=name, port=0, control_port=0)
        with ReplaySensor(path, loop=True) as sensor, Outlet(wire, sensor.name) as outlet:
            outlet.introduce(statue())
            edge = Edge(sensor, Tracker(), Stage([]), outlet)
            signal.signal(signal.SIGTERM, lambda *_: edge.stop())
            endpoint = outlet.publisher.endpoint
            print(endpoint.pose_port, endpoint.control_port, flush=True)
            edge.run()


if __name__ == "__main__":
    main(sys.argv[1])
