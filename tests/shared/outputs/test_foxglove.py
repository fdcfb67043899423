"""Tests that an independent client of Foxglove sees the stage, with left, right, front and back."""

import json
import logging
import socket
import time
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed (the extra foxglove)")
pytest.importorskip("google.protobuf", reason="protobuf is not installed")

from foxglove_client import FoxgloveClient
from live_receivers import turn
from live_scenes import CHAIR_PLACE, CHAIR_TURN, chair, four_characters
from patience import wait_until
from posed_people import performer

from enliven.camera import Intrinsics
from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame
from enliven.health import HealthKind, HealthState, Severity
from enliven.outputs.foxglove.server import FoxgloveServer
from enliven.outputs.live_frame import CharacterInfo, LiveEvent, LiveFrame
from enliven.outputs.opening import open_outputs
from enliven.outputs.output_plan import plan_outputs
from enliven.outputs.settings import LiveOutputSettings, collect_output_settings
from enliven.person import Joint
from enliven.rotation import rotate

CAMERA = Intrinsics(8, 6, 7.0, 7.5, 3.0, 2.5, (0.1, 0.2, 0.03, 0.04, 0.5))


@pytest.fixture
def port():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@pytest.fixture
def server(port):
    with FoxgloveServer(f"foxglove:127.0.0.1:{port}", "127.0.0.1", port) as opened:
        yield opened


def shown(server, client, frame, topic):
    """Sends a frame repeatedly until its message arrives, because a subscription takes effect with a
    delay.
    """

    def arrived():
        server.send(frame)
        return client.newest(topic)

    return wait_until(arrived, topic)


def with_depth(frame: LiveFrame, **keys) -> LiveFrame:
    depth = np.arange(48, dtype=np.uint16).reshape(6, 8) + 1000
    pose = np.eye(4)
    pose[:3, 3] = 0.5, 1.5, 2.0
    pose[:3, :3] = np.diag([1.0, -1.0, -1.0])
    image = DepthFrame(depth, CAMERA, frame.time_ns, "made")
    return replace(frame, depth=image, world_from_camera=pose, **keys)


def placed(transforms) -> dict[str, tuple[np.ndarray, tuple[float, ...]]]:
    rows = {}
    for row in transforms.transforms:
        place, way = row.translation, row.rotation
        rows[row.child_frame_id] = np.array([place.x, place.y, place.z]), (way.x, way.y, way.z, way.w)
    return rows


def in_map(rows, child) -> np.ndarray:
    """Returns the position of a coordinate frame in Foxglove's own axes, through the frame ``world``."""
    base, way = rows["world"]
    return base + turn(way, rows[child][0])


def test_frames_stand_upright_with_left_and_front_on_their_sides(server, port):
    frame = four_characters()
    with FoxgloveClient(port) as client:
        rows = placed(shown(server, client, frame, "/tf"))
    assert {"anna", "ben", "horse", "chair", "performer-1", "performer-2", "prop-3", "prop-4"} <= set(rows)
    body = performer()
    hip, way = rows["performer-1"]
    assert np.allclose(hip, body.joints[Joint.HIP_CENTER], atol=1e-6)
    for axis in np.eye(3):
        assert np.allclose(turn(way, axis), rotate(body.orientations[Joint.HIP_CENTER], axis), atol=1e-6)
    # The performer turns 0.6 rad to the left, so the front moves from +Z towards +X.
    assert turn(way, [0, 0, 1])[0] > 0.5
    expected = rotate(CHAIR_TURN, chair()[0].pivots.mean(0)) + CHAIR_PLACE
    assert np.allclose(rows["chair"][0], expected, atol=1e-5)
    assert np.allclose(turn(rows["chair"][1], [1, 2, 3]), rotate(CHAIR_TURN, [1.0, 2.0, 3.0]), atol=1e-5)
    # Foxglove has +Z up. World up is +Z there, and left stays left of the front.
    assert in_map(rows, "performer-1")[2] == pytest.approx(body.joints[Joint.HIP_CENTER][1], abs=1e-6)
    up, front, left = (turn(rows["world"][1], axis) for axis in ([0, 1, 0], [0, 0, 1], [1, 0, 0]))
    assert np.allclose(up, [0, 0, 1], atol=1e-6) and np.allclose(np.cross(up, front), left, atol=1e-6)


def test_bones_of_rigs_are_frames(server, port):
    frame = four_characters()
    with FoxgloveClient(port, ["/tf"]) as client:
        rows = placed(shown(server, client, frame, "/tf"))
    pose = frame.poses[0]
    for bone, position, linear in zip(
        frame.characters["anna"].character.names, pose.positions, pose.linear, strict=True
    ):
        place, way = rows[f"anna/{bone}"]
        assert np.allclose(place, position, atol=1e-5)
        assert np.allclose(turn(way, [1, 2, 3]), linear @ [1, 2, 3], atol=1e-5)


def test_the_drawing_shows_the_posture(server, port):
    frame = four_characters()
    for name in ("anna", "ben"):
        info = frame.characters[name]
        edges = np.array([[0, 5], [5, 9]], np.int32)
        frame.characters[name] = CharacterInfo(replace(info.character, edges=edges), info.humanoid)
    with FoxgloveClient(port, ["/scene"]) as client:
        scene = shown(server, client, frame, "/scene")
    entities = {entity.id: entity for entity in scene.entities}
    assert set(entities) == {
        "anna",
        "ben",
        "horse",
        "chair",
        "performer-1",
        "performer-2",
        "prop-3",
        "prop-4",
    }
    body, entity = frame.performers[1], entities["performer-1"]
    assert entity.frame_id == "world" and entity.lifetime.seconds == 1
    (lines,) = entity.lines
    drawn = {
        tuple(np.round([p.x, p.y, p.z], 6)): c.a for p, c in zip(lines.points, lines.colors, strict=True)
    }
    for joint in (Joint.HAND_LEFT, Joint.HAND_RIGHT, Joint.KNEE_LEFT, Joint.FOOT_RIGHT):
        opacity = drawn[tuple(np.round(body.joints[joint], 6))]
        assert opacity == pytest.approx(0.25 + 0.75 * body.confidence[joint], abs=1e-6)
    assert entity.texts[0].text == "performer-1"
    assert entities["prop-3"].cubes[0].size.x == pytest.approx(0.2)
    assert entities["prop-4"].spheres[0].pose.position.y == pytest.approx(0.5)
    ends = [(p.x, p.y, p.z) for p in entities["anna"].lines[0].points]
    assert np.allclose(ends, frame.poses[0].positions[[0, 5, 5, 9]], atol=1e-6)
    assert len(entities["horse"].spheres) == len(frame.poses[2].positions), "no edges: dots"
    green, blue = entities["anna"].lines[0].color, entities["ben"].lines[0].color
    assert green.g > green.b and blue.b > blue.g, "anna is held, ben is not"


def test_numbers_for_plots(server, port):
    frame = four_characters()
    with FoxgloveClient(port, ["/stage"]) as client:
        stage = shown(server, client, frame, "/stage")
        assert client.channels["/stage"]["schemaEncoding"] == "jsonschema"
    first = stage["performers"][0]
    assert first["number"] == 1 and first["height"] == pytest.approx(1.75)
    assert first["contact"] == pytest.approx({"left": 0.1, "right": 0.9})
    joints = {joint["name"]: joint for joint in first["joints"]}
    place = [joints["hand_left"][axis] for axis in "xyz"]
    assert np.allclose(place, frame.performers[1].joints[Joint.HAND_LEFT])
    assert {"name": "anna", "held": True} in stage["characters"]
    assert {"name": "chair", "held": False} in stage["characters"]


@pytest.mark.parametrize("mirrored", [False, True])
def test_the_depth_image_and_its_camera(server, port, mirrored):
    frame = with_depth(four_characters(), mirrored=mirrored)
    with FoxgloveClient(port) as client:
        for step in range(1000):
            later = replace(frame, time_ns=frame.time_ns + step * 200_000_000)
            server.send(later)
            if client.newest("/depth") and client.newest("/depth/calibration") and client.newest("/tf"):
                break
        image, camera = client.newest("/depth"), client.newest("/depth/calibration")
        rows = placed(client.newest("/tf"))
    assert (image.encoding, image.width, image.height, image.step) == ("16UC1", 8, 6, 16)
    values = np.frombuffer(image.data, "<u2").reshape(6, 8)
    assert np.array_equal(values, frame.depth.depth[:, ::-1] if mirrored else frame.depth.depth)
    # The camera's target is the same point in both images.
    assert list(camera.K) == [7.0, 0, 4.0 if mirrored else 3.0, 0, 7.5, 2.5, 0, 0, 1]
    assert camera.D[3] == (-0.04 if mirrored else 0.04) and camera.frame_id == image.frame_id == "camera"
    place, way = rows["camera"]
    assert np.allclose(place, [0.5, 1.5, 2.0]) and np.allclose(turn(way, [0, 0, 1]), [0, 0, -1], atol=1e-6)


def test_depth_images_have_a_limited_rate(server, port):
    frame = with_depth(LiveFrame(10**9, {}))
    with FoxgloveClient(port, ["/depth", "/stage"]) as client:
        shown(server, client, frame, "/stage")
        server.send(replace(frame, time_ns=frame.time_ns + 10**9))
        wait_until(lambda: client.newest("/depth"), "the first image")
        client.messages.clear()
        for step in range(1, 31):
            server.send(replace(frame, time_ns=frame.time_ns + 10**9 + step * 33_000_000))
            wait_until(lambda step=step: client.newest("/stage") and len(client.messages["/stage"]) >= step)
        assert 7 <= len(client.messages["/depth"]) <= 10, "ten in a second"


def test_events_and_health_are_logs(server, port):
    state = HealthState(HealthKind.COVERED, Severity.ERROR, 5, "The lens is covered.", "Uncover it.")
    server.put_health([state])
    with FoxgloveClient(port, ["/health", "/events"]) as client:
        wait_until(lambda: client.newest("/health"), "a state that began before the client came")
        line = client.messages["/health"][0][0]
        assert (line.level, line.name) == (4, "lens covered")
        assert line.message == "The lens is covered. Uncover it."
        server.put_health([state])
        server.put_health([])
        wait_until(lambda: client.newest("/health").message == "Resolved: The lens is covered.", "the end")
        assert len(client.messages["/health"]) == 2, "a state that lasts is not repeated"
        server.send(
            LiveFrame(0, {}, events=[LiveEvent("possess", 1, "chair"), LiveEvent("release", 0, "chair")])
        )
        wait_until(lambda: client.newest("/events") and len(client.messages["/events"]) == 2)
        texts = [line.message for line, _ in client.messages["/events"]]
        assert texts == ["performer-1 possess chair", "all performers release chair"]


def test_a_client_may_be_absent_leave_and_come_back(server, port):
    frame = four_characters()
    server.send(frame)
    assert server.errors == 0 and server.trouble == ""
    for _ in range(2):
        with FoxgloveClient(port, ["/tf"]) as client:
            assert placed(shown(server, client, frame, "/tf"))
    wait_until(lambda: not server._transforms.has_sinks(), "the client is gone")


def newest_depth(client) -> int:
    """Returns the time of the newest received depth image, nanoseconds."""
    return max((time_ns for _, time_ns in client.messages["/depth"]), default=0)


def test_a_slow_client_delays_neither_the_edge_nor_others(server, port, caplog):
    frame = with_depth(four_characters())
    large = Intrinsics(640, 480, 500.0, 500.0, 320.0, 240.0)
    frame = replace(frame, depth=DepthFrame(np.ones((480, 640), np.uint16), large, 0, "made"))
    with (
        caplog.at_level(logging.WARNING),
        FoxgloveClient(port, ["/depth", "/tf"]) as slow,
        FoxgloveClient(port, ["/stage"]) as quick,
    ):
        shown(server, slow, frame, "/tf")  # From here on, it reads nothing.
        shown(server, quick, frame, "/stage")
        frame_ns = quick.messages["/stage"][-1][1]
        quick.messages.clear()
        for step in range(1, 301):
            server.send(replace(frame, time_ns=frame.time_ns + step * 200_000_000))
            wait_until(lambda step=step: quick.newest("/stage") and len(quick.messages["/stage"]) >= step)
        # 300 images of 0.6 MB are 184 MB, more than a connection buffers. A call that waited for the slow
        # client would not have returned. The client receives the first images and the newest ones.
        wait_until(
            lambda: (slow.poll(0.1), newest_depth(slow) >= frame_ns + 300 * 200_000_000)[1], "the newest one"
        )
        assert len(slow.messages["/depth"]) < 200
        assert server.errors == 0
        assert len(caplog.records) < 20, "a slow client does not fill the log"


def test_a_replay_that_begins_again_starts_a_new_session(server, port):
    with FoxgloveClient(port, ["/stage"]) as client:
        shown(server, client, LiveFrame(50 * 10**9, {}), "/stage")
        shown(server, client, LiveFrame(51 * 10**9, {}), "/stage")
        first = client.messages["/stage"][-1][1]
        assert abs(first - time.time_ns()) < 60 * 10**9, "times are those of the wall clock"
        server.send(LiveFrame(10**9, {}))
        wait_until(lambda: (client.poll(0.05), [t for t in client.texts if t["op"] == "serverInfo"])[1])
        (info,) = [text for text in client.texts if text["op"] == "serverInfo"]
        assert info["sessionId"] != client.info["sessionId"]


def test_a_port_in_use_is_refused_and_leaves_nothing_running(server, port):
    import threading

    before = threading.active_count()
    with pytest.raises(
        ResourceError, match=rf"port {port} of 127\.0\.0\.1.*Address already in use.*another port"
    ):
        open_outputs(collect_output_settings(["vmc:127.0.0.1", f"foxglove:127.0.0.1:{port}"], {}))
    assert threading.active_count() == before


@pytest.mark.slow
def test_the_port_is_free_again_after_the_end(port):
    for _ in range(2):
        with open_outputs(collect_output_settings([f"foxglove:localhost:{port}"], {})) as outputs:
            wait_until(lambda outputs=outputs: outputs.is_ready, "the server")
            with FoxgloveClient(port) as client:
                assert client.info["op"] == "serverInfo"


def test_an_address_that_others_reach_needs_permission(port):
    word = f"foxglove:0.0.0.0:{port}"
    with pytest.raises(InputError, match=r"could watch the performers.*ssh -L.*insecure = true"):
        open_outputs(collect_output_settings([word], {}))
    (plan,) = plan_outputs(collect_output_settings([word], {}), insecure=True)
    assert plan_outputs({"watch": LiveOutputSettings(word, insecure=True)})[0].place == plan.place
    with plan.open(), FoxgloveClient(port):
        pass
    with pytest.raises(InputError, match="insecure does not apply to the protocol vmc"):
        open_outputs({"x": LiveOutputSettings("vmc:127.0.0.1", insecure=True)})


def test_log_of_the_library_does_not_reach_python(port, monkeypatch):
    """The library's threads would wait for the interpreter while holding locks that the edge needs: a
    deadlock.
    """
    records = []
    handler = logging.Handler()
    handler.emit = records.append
    monkeypatch.setattr(logging.getLogger("foxglove"), "handlers", [handler])
    with FoxgloveServer("fox", "127.0.0.1", port) as opened:
        logging.getLogger("foxglove").setLevel(logging.DEBUG)  # as a program that hosts an edge might do
        with FoxgloveClient(port, ["/stage"]) as client:
            shown(opened, client, four_characters(), "/stage")
            again = [{"id": 100, "channelId": client.channels["/stage"]["id"]}]
            client.socket.send(json.dumps({"op": "subscribe", "subscriptions": again}))
            wait_until(lambda: client.poll(0.05) or [text for text in client.texts if text["op"] == "status"])
    assert records == []
