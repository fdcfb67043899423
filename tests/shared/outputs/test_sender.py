"""Tests that an output never delays the edge, and outlives its receiver."""

import socket
import threading
import time

from live_receivers import OscReceiver
from live_scenes import four_characters
from patience import until
from posed_people import performer

from enliven.outputs.live_frame import LiveFrame, PerformerSlots
from enliven.outputs.opening import open_outputs
from enliven.outputs.sender import Sender
from enliven.outputs.settings import outputs_of


class Slow:
    """An output that converts a frame only when the test lets it."""

    def __init__(self) -> None:
        self.go, self.frames, self.begun = threading.Semaphore(0), [], 0

    def check(self, characters) -> None:
        pass

    def packets(self, frame: LiveFrame) -> list[bytes]:
        self.begun += 1
        self.go.acquire()
        self.frames.append(frame.time_ns)
        return [b"packet"]


def sender_of(output, port: int = 9) -> Sender:
    return Sender("test", output, socket.AF_INET, ("127.0.0.1", port))


def test_a_slow_output_gets_the_newest_frame_and_never_blocks():
    output = Slow()
    with sender_of(output) as sender:
        sender.put(LiveFrame(-1, {}))
        until(lambda: output.begun, "the first frame")
        begin = time.monotonic()
        for k in range(500):
            sender.put(LiveFrame(k, {}))
        assert time.monotonic() - begin < 5.0, "500 frames were handed over although none was sent"
        output.go.release(2)
        until(lambda: len(output.frames) == 2)
        assert output.frames == [-1, 499], "the frame after a slow one is the newest"
        assert sender.skipped == 499


def test_a_receiver_may_start_late_and_restart():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with open_outputs(outputs_of([f"vmc:127.0.0.1:{port}"], {})) as outputs:
        (sender,) = outputs.senders
        frame = four_characters()

        def lost():
            sender.put(frame)
            return sender.errors

        until(lost, "a lost packet")
        for _ in range(2):
            with OscReceiver(port) as receiver:

                def arrived(receiver=receiver):
                    sender.put(frame)
                    return "/VMC/Ext/OK" in receiver.values and len(receiver.values) > 60

                until(arrived, "a whole frame")
            before = sender.errors
            until(lambda before=before: lost() > before, "the end of the receiver is noticed")


def test_a_fault_of_an_output_is_counted_and_the_next_frame_is_sent():
    class Faulty(Slow):
        def packets(self, frame):
            if frame.time_ns == 0:
                raise ValueError("broken")
            return super().packets(frame)

    output = Faulty()
    with sender_of(output) as sender:
        sender.put(LiveFrame(0, {}))
        until(lambda: sender.errors)
        assert "could not be converted (broken)" in sender.trouble
        output.go.release()
        sender.put(LiveFrame(1, {}))
        until(lambda: output.frames == [1])


def test_a_packet_that_is_too_long_is_counted():
    class Long(Slow):
        def packets(self, frame):
            return [bytes(70_000)]

    with sender_of(Long()) as sender:
        sender.put(LiveFrame(0, {}))
        until(lambda: sender.errors)
        assert sender.trouble


def test_performers_keep_their_numbers_and_free_ones_are_used_again():
    numbers = PerformerSlots()
    at = lambda *ids, ns: numbers.number([performer(i) for i in ids], ns)  # noqa: E731
    named, events = at(41, 17, ns=0)
    assert {n: b.id for n, b in named.items()} == {1: 41, 2: 17}
    assert [(e.kind, e.performer) for e in events] == [("enter", 1), ("enter", 2)]
    assert {n: b.id for n, b in at(17, ns=10**9)[0].items()} == {2: 17}
    assert {n: b.id for n, b in at(41, 17, ns=2 * 10**9)[0].items()} == {1: 41, 2: 17}, "a short loss"
    assert {n: b.id for n, b in at(17, ns=9 * 10**9)[0].items()} == {2: 17}, "the sensor paused"
    named, events = at(17, 99, ns=10 * 10**9)
    assert {n: b.id for n, b in named.items()} == {1: 99, 2: 17}
    assert [(e.kind, e.performer) for e in events] == [("enter", 1)]
    named, events = at(17, ns=1)
    assert named.keys() == {2} and events[0].kind == "leave", "the clock was set back"
