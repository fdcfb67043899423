"""Tests that outputs never delay the edge or each other, and keep working without their receivers."""

import contextlib
import socket
import threading

import pytest
from live_receivers import OscReceiver
from live_scenes import four_characters
from patience import wait_until
from posed_people import performer

from enliven.outputs.frame_thread import FrameThread
from enliven.outputs.live_frame import LiveEvent, LiveFrame, PerformerSlots
from enliven.outputs.opening import open_outputs
from enliven.outputs.settings import collect_output_settings
from enliven.outputs.udp_sender import UdpSender


class Collector:
    """An output that stores its frames and its thread, and makes one packet of each frame."""

    def __init__(self) -> None:
        self.frames, self.threads = [], set()

    def encode_packets(self, frame: LiveFrame) -> list[bytes]:
        self.frames.append(frame)
        self.threads.add(threading.get_ident())
        return [b"packet"]

    @property
    def times(self) -> list[int]:
        return [frame.time_ns for frame in self.frames]


class Slow(Collector):
    """An output that converts a frame only when the test allows it."""

    def __init__(self) -> None:
        super().__init__()
        self.go, self.begun = threading.Semaphore(0), 0

    def encode_packets(self, frame: LiveFrame) -> list[bytes]:
        self.begun += 1
        self.go.acquire()
        return super().encode_packets(frame)


class Faulty(Collector):
    """An output that raises an error for the frame with time 0."""

    def encode_packets(self, frame: LiveFrame) -> list[bytes]:
        if frame.time_ns == 0:
            raise ValueError("broken")
        return super().encode_packets(frame)


@contextlib.contextmanager
def outputs_with(*outputs, port: int = 9):
    """Yields a thread that sends to the given outputs, and their senders."""
    place = ("127.0.0.1", port)
    with contextlib.ExitStack() as stack:
        senders = [
            stack.enter_context(UdpSender(type(output).__name__, output, socket.AF_INET, place))
            for output in outputs
        ]
        yield stack.enter_context(FrameThread(senders)), senders


def test_a_slow_output_gets_the_newest_frame_with_all_events_and_never_blocks():
    slow, other = Slow(), Collector()
    with outputs_with(slow, other) as (outputs, _):
        outputs.put(LiveFrame(-1, {}))
        wait_until(lambda: slow.begun, "the first frame")
        for k in range(500):  # All are accepted although none can be sent.
            events = [LiveEvent("enter", k)] if k % 100 == 0 else []
            outputs.put(LiveFrame(k, {}, events=events))
        slow.go.release(2)
        wait_until(lambda: len(other.frames) == 2)
        assert slow.times == other.times == [-1, 499], "the frame after a slow one is the newest"
        for output in (slow, other):
            assert [event.performer for event in output.frames[1].events] == [0, 100, 200, 300, 400]


def test_all_outputs_are_served_by_one_thread_that_ends_with_them():
    collectors = [Collector() for _ in range(5)]
    with outputs_with(*collectors) as (outputs, _):
        for k in range(20):
            outputs.put(LiveFrame(k, {}))
            wait_until(lambda k=k: all(output.times[-1:] == [k] for output in collectors), f"frame {k}")
    assert all(output.times == list(range(20)) for output in collectors), "each frame once"
    (thread,) = set.union(*(output.threads for output in collectors))
    assert thread != threading.get_ident()
    wait_until(lambda: thread not in {running.ident for running in threading.enumerate()}, "its end")


def test_the_last_frame_is_sent_before_the_end():
    collector = Collector()
    with outputs_with(collector) as (outputs, _):
        for k in range(100):
            outputs.put(LiveFrame(k, {}))
    wait_until(lambda: collector.times[-1:] == [99], "the last frame")
    outputs.close()  # A second call does nothing.


@pytest.mark.slow
def test_a_receiver_may_start_late_and_restart():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with open_outputs(collect_output_settings([f"vmc:127.0.0.1:{port}"], {})) as outputs:
        (sender,) = outputs.statuses
        frame = four_characters()

        def lost():
            outputs.put(frame)
            return sender.errors

        wait_until(lost, "a lost packet")
        for _ in range(2):
            with OscReceiver(port) as receiver:

                def arrived(receiver=receiver):
                    outputs.put(frame)
                    return "/VMC/Ext/OK" in receiver.values and len(receiver.values) > 60

                wait_until(arrived, "a whole frame")
            before = sender.errors
            wait_until(lambda before=before: lost() > before, "the end of the receiver is noticed")


def test_a_fault_of_an_output_is_counted_and_stops_neither_its_next_frame_nor_others():
    faulty, after = Faulty(), Collector()
    with outputs_with(faulty, after) as (outputs, senders):
        outputs.put(LiveFrame(0, {}))
        wait_until(lambda: after.times == [0], "the frame of the other output")
        assert senders[0].errors == 1
        assert "could not be converted (broken)" in senders[0].trouble
        outputs.put(LiveFrame(1, {}))
        wait_until(lambda: faulty.times == [1] and after.times == [0, 1], "the next frame")


@pytest.mark.slow
def test_an_absent_receiver_costs_the_others_nothing():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        absent = free.getsockname()[1]
    with OscReceiver() as receiver:
        words = [f"osc:127.0.0.1:{absent}", f"vmc:127.0.0.1:{receiver.port}"]
        with open_outputs(collect_output_settings(words, {})) as outputs:
            missing, present = outputs.statuses

            def both():
                outputs.put(four_characters())
                return missing.errors and "/VMC/Ext/OK" in receiver.values

            wait_until(both, "a lost packet, and a packet that arrives")
            assert present.errors == 0


def test_a_packet_that_is_too_long_is_counted():
    class Long(Collector):
        def encode_packets(self, frame):
            return [bytes(70_000)]

    with outputs_with(Long()) as (outputs, senders):
        outputs.put(LiveFrame(0, {}))
        wait_until(lambda: senders[0].errors)
        assert senders[0].trouble


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
