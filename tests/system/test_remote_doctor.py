"""Tests of ``enliven doctor --remote``: the health of a running edge, from another terminal or machine."""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Iterator

import pytest
import zmq
from msgspec.structs import replace
from real_edge import RealEdge

from enliven import cli
from enliven.commands import doctor
from enliven.wire import StatusMessage, free_ports, pack_stream
from enliven.wire.streams import HealthMessage

LACKING = 4
FINE = StatusMessage("stage", 7, 1, 0, "camera 1", "tracking", fps=29.7, latency_p50_ms=12.4, performers=1)


@contextlib.contextmanager
def published(*messages: bytes) -> Iterator[str]:
    """Returns the address of a socket that publishes messages repeatedly, as an edge does."""
    (port,) = free_ports(1)
    socket, ended = zmq.Context.instance().socket(zmq.PUB), threading.Event()
    socket.setsockopt(zmq.LINGER, 0)
    socket.bind(f"tcp://127.0.0.1:{port}")

    def publish() -> None:
        while not ended.wait(0.05):
            for message in messages:
                socket.send(message)

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        yield f"127.0.0.1:{port}"
    finally:
        ended.set()
        thread.join()
        socket.close()


def checked(address: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, dict]]:
    """Returns the exit code, and the checks by name."""
    code = cli.run(["doctor", "--remote", address, "--json"])
    return code, {check["name"]: check for check in json.loads(capsys.readouterr().out)}


def test_healthy_edge_passes_all_checks(capsys):
    with published(pack_stream(FINE)) as address:
        code, checks = checked(address, capsys)
    assert code == 0 and all(check["ok"] for check in checks.values())
    assert checks["edge"]["detail"] == "stage: tracking, 1 performer"
    assert checks["rate"]["detail"].startswith("30 poses") and checks["delay"]["detail"].startswith("12 ms")


@pytest.mark.parametrize(
    ("change", "wrong"),
    [
        ({"phase": "ended"}, "edge"),
        ({"sensor": ""}, "sensor"),
        ({"health": [HealthMessage("sensor lost", 2, 0, "It was unplugged.", "Plug it in.")]}, "sensor lost"),
    ],
)
def test_remote_problems_are_reported_with_advice(change, wrong, capsys):
    with published(pack_stream(replace(FINE, **change))) as address:
        code, checks = checked(address, capsys)
    assert code == LACKING and [name for name, check in checks.items() if not check["ok"]] == [wrong]
    assert checks[wrong]["mend"]


def test_a_note_alone_is_no_fault_and_other_messages_are_passed_over(capsys):
    note = HealthMessage("learning the room", 0, 0, "The room is learnt.", "Wait.")
    status = replace(FINE, health=[note])
    with published(b"no message of enliven", b"", pack_stream(status)) as address:
        code, checks = checked(address, capsys)
    assert code == 0 and checks["learning the room"]["ok"]


def test_silent_edge_is_reported_with_its_address(monkeypatch, capsys):
    monkeypatch.setattr(doctor, "MAX_HEARTBEAT_WAIT_S", 0.2)
    (port,) = free_ports(1)
    code, checks = checked(f"127.0.0.1:{port}", capsys)
    assert code == LACKING and str(port) in checks["edge"]["detail"] and "firewall" in checks["edge"]["mend"]


def test_edge_of_another_version_is_reported(monkeypatch, capsys):
    monkeypatch.setattr(doctor, "MAX_HEARTBEAT_WAIT_S", 0.5)
    other = bytearray(pack_stream(FINE))
    other[len("status") + 1] += 1  # after the topic and a zero
    with published(bytes(other)) as address:
        code, checks = checked(address, capsys)
    assert (
        code == LACKING and "version" in checks["edge"]["detail"] and "same version" in checks["edge"]["mend"]
    )


def test_invalid_address_is_refused(capsys):
    assert cli.run(["doctor", "--remote", "a b:c"]) == 3
    assert "HOST" in capsys.readouterr().err


def test_text_from_an_edge_controls_no_terminal(capsys):
    named = replace(FINE, edge="stage\x1b[2J")
    with published(pack_stream(named)) as address:
        cli.run(["doctor", "--remote", address])
    assert "\x1b[2J" not in capsys.readouterr().out


@pytest.mark.system
@pytest.mark.slow
def test_real_edge_is_checked(capsys):
    edge = RealEdge("--sensor", "synthetic")
    try:
        edge.wait()
        code, checks = checked(edge.address, capsys)
    finally:
        edge.close()
    assert checks["edge"]["ok"] and "1 performer" in checks["edge"]["detail"] and code in (0, LACKING)
    assert "synthetic" in checks["sensor"]["detail"]
