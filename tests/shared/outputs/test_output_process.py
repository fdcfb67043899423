"""Tests that the output process never delays its program, is restarted, and leaves no processes or files
behind.
"""

import contextlib
import logging
import os
import signal
import socket
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from live_receivers import OscReceiver
from live_scenes import four_characters
from patience import wait_until

from enliven.camera import Intrinsics
from enliven.document import Character, SkinWeights
from enliven.frames import DepthFrame
from enliven.outputs.live_frame import CharacterInfo, LiveEvent, LiveFrame
from enliven.outputs.opening import OutputSet, open_outputs
from enliven.outputs.output_plan import plan_outputs
from enliven.outputs.settings import collect_output_settings

posix_only = pytest.mark.skipif(sys.platform == "win32", reason="this system has no such signals")


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def ready(outputs: OutputSet) -> int:
    """Waits until the process sends, and returns its process id."""
    wait_until(lambda: outputs.is_ready, "the process")
    assert outputs.process_id is not None
    return outputs.process_id


def seconds_of(receiver: OscReceiver) -> float | None:
    return receiver.values.get("/enliven/time", (None,))[0]


@pytest.mark.slow
@posix_only
def test_killed_process_is_restarted_and_sends_again(caplog):
    with (
        caplog.at_level(logging.WARNING),
        OscReceiver() as receiver,
        open_outputs(collect_output_settings([f"vmc:127.0.0.1:{receiver.port}/anna"], {})) as outputs,
    ):
        frame, ended = four_characters(), set()

        def arrived():
            outputs.put(frame)
            return ("/VMC/Ext/Bone/Pos", "Hips") in receiver.values

        for _ in range(2):
            process = ready(outputs)
            wait_until(arrived, "a frame")
            os.kill(process, signal.SIGKILL)
            ended.add(process)
            wait_until(lambda: outputs.process_id not in ended, "the end is noticed")
            ready(outputs)
            receiver.values.clear()
        wait_until(arrived, "a frame of the third process, which needs all characters again")
        assert outputs.troubles == {} and outputs.process_id not in ended
    texts = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert ["starts again now" in text or "starts again in 1 s" in text for text in texts] == [True, True], (
        texts
    )
    assert all(
        "the process of the live outputs has ended: signal 9 ended the process" in text for text in texts
    )


def cloud() -> CharacterInfo:
    """Returns a character with 20,000 nodes. A connection buffers only few poses of this size."""
    corners, faces = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32)
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.float32([1, 0, 0, 0]), (3, 1)))
    pivots = np.random.default_rng(0).uniform(-1.0, 1.0, (20_000, 3)).astype(np.float32)
    return CharacterInfo(Character("cloud", corners, faces, skin, pivots, np.zeros((0, 2), np.int32)))


@pytest.mark.slow
@posix_only
def test_stopped_process_blocks_nothing_and_gets_the_newest_frame_with_all_events():
    with (
        OscReceiver() as receiver,
        open_outputs(collect_output_settings([f"osc:127.0.0.1:{receiver.port}"], {})) as outputs,
    ):
        process, info = ready(outputs), cloud()
        frame = LiveFrame(0, {}, [info.character.rest_pose()], {"cloud": info})
        outputs.put(frame)
        wait_until(lambda: seconds_of(receiver) == 0.0, "the first frame")
        os.kill(process, signal.SIGSTOP)
        try:
            for k in range(
                1, 101
            ):  # 100 MB, more than the connection buffers. A blocking call would never return.
                events = [LiveEvent("possess", 1, f"event {k}")] if k % 20 == 0 else []
                outputs.put(replace(frame, time_ns=k * 10**9, events=events))
        finally:
            os.kill(process, signal.SIGCONT)
        wait_until(lambda: seconds_of(receiver) == 100.0, "the newest frame, without another one")
        for k in range(20, 101, 20):
            wait_until(lambda k=k: ("/enliven/event/possess", f"event {k}") in receiver.values, f"event {k}")


@posix_only
def test_termination_signal_of_a_service_leaves_the_end_to_the_program():
    with (
        OscReceiver() as receiver,
        open_outputs(collect_output_settings([f"osc:127.0.0.1:{receiver.port}"], {})) as outputs,
    ):
        process = ready(outputs)
        os.kill(process, signal.SIGTERM)
        os.kill(process, signal.SIGINT)
        outputs.put(LiveFrame(0, {}))
        wait_until(lambda: seconds_of(receiver) == 0.0, "a frame after the signals")
        assert outputs.process_id == process
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


def test_the_last_frame_is_sent_although_the_process_has_not_started_yet():
    with OscReceiver() as receiver:
        with open_outputs(collect_output_settings([f"osc:127.0.0.1:{receiver.port}"], {})) as outputs:
            outputs.put(LiveFrame(0, {}, events=[LiveEvent("possess", 1, "first")]))
            outputs.put(LiveFrame(10**9, {}))
        wait_until(lambda: ("/enliven/event/possess", "first") in receiver.values, "the event")
        assert seconds_of(receiver) == 0.0, "the first frame that is sent has the time 0"
        outputs.close()  # A second call does nothing.
        outputs.put(LiveFrame(0, {}))


OPEN = """
import sys, time
from enliven.outputs.live_frame import LiveFrame
from enliven.outputs.opening import open_outputs
from enliven.outputs.output_plan import plan_outputs
from enliven.outputs.settings import collect_output_settings

outputs = open_outputs(collect_output_settings(sys.argv[1:], {}))
while not outputs.is_ready:
    time.sleep(0.01)
print(outputs.process_id, flush=True)
while True:
    outputs.put(LiveFrame(0, {}))
    time.sleep(0.01)
"""


@posix_only
@pytest.mark.timeout(300)
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_process_ends_with_a_killed_program(number):
    with OscReceiver() as receiver:
        words = [f"osc:127.0.0.1:{receiver.port}", f"foxglove:127.0.0.1:{free_port()}"]
        program = subprocess.Popen([sys.executable, "-c", OPEN, *words], stdout=-1, stderr=-1, text=True)
        try:
            assert int(program.stdout.readline()) > 0
            wait_until(lambda: seconds_of(receiver) == 0.0, "a frame")
        finally:
            program.send_signal(number)
        # Both processes share stderr, which is closed when the last of them ends.
        _, errors = program.communicate(timeout=120)
    assert program.returncode == -number and errors == ""


def shared_memory() -> set[str]:
    return set(os.listdir("/dev/shm")) if Path("/dev/shm").is_dir() else set()


@pytest.mark.slow
@posix_only
def test_nothing_is_left_after_the_end():
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed (the extra foxglove)")
    descriptors = Path("/proc/self/fd")

    def open_files() -> int:
        return len(list(descriptors.iterdir())) if descriptors.is_dir() else 0

    files, memory = open_files(), shared_memory()
    with open_outputs(collect_output_settings([f"foxglove:127.0.0.1:{free_port()}"], {})) as outputs:
        process = ready(outputs)
        assert shared_memory() <= memory, "the memory has no name that could be left behind"
        os.kill(process, signal.SIGKILL)
        wait_until(lambda: outputs.process_id not in (process, None), "the next process")
        second = ready(outputs)
    assert open_files() <= files
    assert "live outputs" not in {thread.name for thread in threading.enumerate()}
    for old in (process, second):
        with pytest.raises(ChildProcessError):  # It has been waited for, so it is not a zombie.
            os.waitpid(old, os.WNOHANG)


@pytest.mark.slow
def test_depth_images_reach_a_client_from_shared_memory():
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed (the extra foxglove)")
    pytest.importorskip("google.protobuf", reason="protobuf is not installed")
    from foxglove_client import FoxgloveClient

    camera, port = Intrinsics(8, 6, 7.0, 7.5, 3.0, 2.5), free_port()
    with open_outputs(collect_output_settings([f"foxglove:127.0.0.1:{port}"], {})) as outputs:
        ready(outputs)
        with FoxgloveClient(port, ["/depth"]) as client:
            images = {}
            step = 0

            def seven_arrived():
                nonlocal step
                step += 1
                depth = np.full((6, 8), 1000 + step % 5000, np.uint16)
                image = DepthFrame(depth, camera, step * 10**8, "made")
                outputs.put(LiveFrame(image.time_ns, {}, depth=image))
                if client.newest("/depth"):
                    images.update((time_ns, image) for image, time_ns in client.messages["/depth"])
                return len(images) >= 7

            wait_until(seven_arrived, "seven images, which is more than the memory has places")
    values = [np.frombuffer(image.data, "<u2") for image in images.values()]
    assert all((image == image[0]).all() for image in values), "no image is a mixture of two"
    assert len({int(image[0]) for image in values}) == len(images), "no image came twice"


@pytest.mark.slow
def test_characters_join_change_and_leave_while_the_process_runs():
    with (
        OscReceiver() as receiver,
        open_outputs(collect_output_settings([f"vmc:127.0.0.1:{receiver.port}/anna"], {})) as outputs,
    ):
        everyone = four_characters()
        anna = everyone.characters["anna"]
        ready(outputs)

        def trackers_with(frame: LiveFrame) -> set[str]:
            receiver.values.clear()

            def came():
                outputs.put(frame)
                return "/VMC/Ext/OK" in receiver.values and "/VMC/Ext/T" in receiver.values

            wait_until(came, "a frame")
            return {key[1] for key in receiver.values if key[0] == "/VMC/Ext/Tra/Pos"}

        def with_characters(**infos: CharacterInfo) -> LiveFrame:
            poses = [pose for pose in everyone.poses if pose.character in infos]
            return replace(everyone, poses=poses, characters=infos)

        def settles(frame: LiveFrame, has_chair: bool, status: int):
            def settled():
                names = trackers_with(frame)
                return ("chair" in names) == has_chair and receiver.values["/VMC/Ext/OK"][0] == status

            wait_until(settled)

        chair = everyone.characters["chair"]
        settles(with_characters(anna=anna), False, 1)
        settles(with_characters(anna=anna, chair=chair), True, 1)
        settles(with_characters(chair=chair), True, 0)
        settles(with_characters(anna=anna, chair=CharacterInfo(chair.character)), True, 1)
        without_bones = CharacterInfo(anna.character)
        settles(with_characters(anna=without_bones, chair=chair), True, 0)


@pytest.mark.slow
def test_a_port_taken_after_the_check_is_named_and_tried_again(caplog):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed (the extra foxglove)")
    port = free_port()
    plans = plan_outputs(collect_output_settings([f"foxglove:127.0.0.1:{port}"], {}))
    with contextlib.ExitStack() as stack:
        stack.enter_context(caplog.at_level(logging.WARNING))
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as other:
            other.bind(("127.0.0.1", port))
            other.listen(1)
            outputs = stack.enter_context(OutputSet(plans))
            wait_until(lambda: "cannot be opened" in "".join(outputs.troubles.values()), "the reason")
        ready(outputs)
        assert outputs.troubles == {}
    assert any(
        f"port {port} of 127.0.0.1 cannot be opened" in record.getMessage() for record in caplog.records
    )
