"""Tests of both programs with physics: a chair walks through a tower, and a late viewer sees the boxes."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import time
from pathlib import Path

import av
import msgspec
import numpy as np
import pytest
from patience import TIMEOUT_S, wait_until

from enliven.document.props import Props
from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.recording import Recorder, Recording
from enliven.wire.convert import message_to_props, props_to_message
from enliven.wire.streams import PropsMessage
from enliven.wire.topics import PROPS
from enliven_edge.network.publisher import Publisher
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture
from enliven_viewer.link.edge_client import EdgeClient

pytestmark = pytest.mark.system
FRAMES = 42
with_engine = pytest.mark.skipif(
    importlib.util.find_spec("mujoco") is None,
    reason="the physics engine is an extra: pip install ./edge[physics]",
)


def walk(path: Path) -> None:
    """Writes a recording of a person that stands for half a second and then walks to their left."""
    with Recorder(path) as recorder:
        for k in range(FRAMES):
            hip = np.array([max(0.0, 0.045 * (k - 15)), 0.95, 0.0])
            posture = Posture(hip, standing_pose(elbow=1.5), lengths_for_height(1.75))
            body = Body(1, posture.joints(), np.ones(20))
            recorder.write_frame(BodyFrame([body], k * 33_333_333, "walker"))


@with_engine
@pytest.mark.slow
def test_a_chair_walks_through_a_tower(tmp_path):
    walk(tmp_path / "walk.mcap")
    command = [sys.executable, "-m", "enliven", "run", "--recording", str(tmp_path / "walk.mcap")]
    command += ["--physics", "boxes", "--film", "--possess-at", "0.1", "--out", str(tmp_path)]
    command += ["--size", "640x360"]
    take = tmp_path / "take.mcap"
    done = subprocess.run([*command, "--record", str(take)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    props = [
        message_to_props(msgspec.msgpack.decode(data, type=PropsMessage))
        for _, data in Recording(take).messages("props")
    ]
    # The boxes exist in every frame from the time at which the performer's position is known.
    times = [k * 33_333_333 for k in range(FRAMES)]
    assert 30 < len(props) < FRAMES and [p.time_ns for p in props] == times[-len(props) :]
    first, last = props[0].positions, props[-1].positions
    assert np.abs(props[3].positions - first).max() < 0.005, "the towers do not stand"
    # The first tower, 0.62 m to the left, is in the way; its boxes move in the chair's direction.
    assert (last[:24, 1] - first[:24, 1]).min() < -0.3
    assert (last[:24, 0] - first[:24, 0]).mean() > 0.15
    half = float(props[0].sizes[0, 0])
    lowest = np.array([p.positions[:, 1].min() for p in props])
    # The chair may press boxes into the floor for a moment. None stays in the floor or falls through it.
    assert lowest.min() > 0.5 * half and np.maximum(lowest[1:], lowest[:-1]).min() > 0.85 * half
    assert "boxes down" in props[-1].note
    with av.open(str(tmp_path / "enliven.mp4")) as film:
        pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(film.streams.video[0])]
    before, picture = (greens(pictures[k]) for k in (0, 15))
    assert picture > before + 125, f"no box is in the picture: {before}, {picture}"


def greens(picture: np.ndarray) -> int:
    """Returns the number of pixels that are as green as the second layer's boxes. Chair and floor are not
    green.
    """
    red, green, blue = picture.astype(float).transpose(2, 0, 1)
    return int(((green > 1.15 * red) & (green > 1.1 * blue)).sum())


@pytest.mark.slow
def test_missing_physics_engine_is_reported_with_the_install_command(tmp_path):
    """The physics engine is an optional extra, which is not installed here."""
    blind = "import importlib.util as u, sys; find = u.find_spec\n"
    blind += "u.find_spec = lambda name, *more: None if name == 'mujoco' else find(name, *more)\n"
    blind += (
        "from enliven.cli import main; sys.argv = ['enliven', 'edge', '--physics', 'boxes']; sys.exit(main())"
    )
    done = subprocess.run(
        [sys.executable, "-c", blind], capture_output=True, text=True, timeout=5 * TIMEOUT_S
    )
    assert done.returncode == 4, done.stderr
    assert "enliven-edge[physics]" in done.stderr and "Traceback" not in done.stderr


def test_late_viewer_sees_the_props():
    props = Props(
        5,
        np.arange(2),
        np.array([0, 1], np.uint8),
        np.full((2, 3), 0.1, np.float32),
        np.full((2, 3), 9, np.uint8),
        np.array([[1.0, 0.1, 0.0], [2.0, 0.1, 0.0]]),
        np.tile([1.0, 0, 0, 0], (2, 1)),
    )
    with Publisher(name=f"props-{time.monotonic_ns()}", pose_port=0, control_port=0) as publisher:
        publisher.publish(props_to_message(props))
        late = EdgeClient([publisher.endpoint])
        received: list[Props] = []

        def came() -> bool:
            publisher.poll()
            late.poll()
            received.extend(late.take(PROPS))
            return bool(received)

        wait_until(came, "the props")
        late.close()
    assert received and np.allclose(received[0].positions, props.positions, atol=3e-4)
