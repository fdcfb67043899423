"""Tests of discovery with real multicast DNS on loopback: edges appear, change, vanish, and send false
data.
"""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st
from patience import wait_until

from enliven.commands.doctor import check_announced_edges
from enliven.doctor import Check
from enliven.errors import InputError
from enliven.keys.key_files import KeyStore, PairedEdge
from enliven.peers.announcement import SERVICE_TYPE, Announcement, pack_announcement, parse_announcement
from enliven.peers.announcer import Announcer, list_own_addresses
from enliven.peers.edge_browser import DiscoveredEdge, EdgeBrowser, check_edge, is_on_local_network
from enliven.wire import VERSION, free_ports

zeroconf = pytest.importorskip("zeroconf")
LOOPBACK = ["127.0.0.1"]
RECORD = {k.encode(): v.encode() for k, v in pack_announcement(Announcement("x", 1, 2)).items()}


SLOW = pytest.mark.slow
"""Registration and search take several seconds each."""


@pytest.fixture
def listening() -> Iterator[int]:
    """Yields the port of a program that accepts connections, as an edge does."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


@pytest.fixture
def browser() -> Iterator[EdgeBrowser]:
    with contextlib.closing(EdgeBrowser(LOOPBACK)) as opened:
        yield opened


def named(browser: EdgeBrowser, name: str) -> list[DiscoveredEdge]:
    """Returns the found edges with a name. Other tests on this machine may announce further edges."""
    return [edge for edge in browser.edges if edge.announcement.name == name]


def unique(request: pytest.FixtureRequest) -> str:
    return f"{request.node.name[:40]}-{id(request) % 10_000}"


@SLOW
def test_edge_is_found_changes_and_vanishes(
    browser: EdgeBrowser, listening: int, request: pytest.FixtureRequest
) -> None:
    name = unique(request)
    with Announcer(Announcement(name, listening, 6001, characters=2), "127.0.0.1") as announcer:
        wait_until(lambda: any(edge.is_usable for edge in named(browser, name)), "the edge")
        (edge,) = named(browser, name)
        assert edge.endpoint.host == "127.0.0.1" and edge.endpoint.pose_port == listening
        assert edge.endpoint.control_port == 6001 and edge.announcement.characters == 2
        announcer.set_characters(5)
        wait_until(lambda: named(browser, name)[0].announcement.characters == 5, "the change")
    wait_until(lambda: not named(browser, name), "its end")


@SLOW
def test_two_edges_of_one_name_are_both_listed(
    browser: EdgeBrowser, listening: int, request: pytest.FixtureRequest
) -> None:
    name = unique(request)
    with contextlib.ExitStack() as stack:
        for control in (6001, 6002):
            announcer = Announcer(Announcement(name, listening, control), "127.0.0.1")
            stack.enter_context(announcer)
            wait_until(lambda a=announcer: a.name, "its registration")
        wait_until(lambda: len(named(browser, name)) == 2, "both edges")
        first, second = named(browser, name)
        assert first.service != second.service and second.service.startswith(f"{name}-2")
        assert {first.endpoint.control_port, second.endpoint.control_port} == {6001, 6002}


@SLOW
def test_edge_of_another_version_is_listed_with_its_problem(
    browser: EdgeBrowser, listening: int, request: pytest.FixtureRequest
) -> None:
    name = unique(request)
    with Announcer(Announcement(name, listening, 6001, wire_version=VERSION + 1), "127.0.0.1"):
        wait_until(lambda: any(edge.host for edge in named(browser, name)), "the edge")
        (edge,) = named(browser, name)
        assert not edge.is_usable and f"version {VERSION + 1}" in edge.problem


def test_crashed_edge_is_listed_as_silent(browser: EdgeBrowser, request: pytest.FixtureRequest) -> None:
    name = unique(request)
    (port,) = free_ports(1)
    with Announcer(Announcement(name, port, 6001), "127.0.0.1"):
        wait_until(lambda: named(browser, name), "the edge")
        assert named(browser, name)[0].problem == "does not answer"


def find_checks(name: str) -> dict[str, Check]:
    """Returns the checks of all announced edges, as soon as they include an edge.

    On a busy machine, an answer may take longer than a search.
    """
    checks: dict[str, Check] = {}

    def has_answered() -> bool:
        checks.update((check.name, check) for check in check_announced_edges(1.5, LOOPBACK))
        return name in checks

    wait_until(has_answered, "an answer")
    return checks


@SLOW
def test_pairing_is_shown(
    listening: int, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    name = unique(request)
    with Announcer(Announcement(name, listening, 6001, has_keys=True), "127.0.0.1") as announcer:
        wait_until(lambda: announcer.name, "its registration")
        checks = find_checks(name)
        assert not checks[name].ok and f"enliven pair 127.0.0.1:{listening}:6001 CODE" in checks[name].remedy
        KeyStore().add_edge(PairedEdge(bytes(32), name, "127.0.0.1", 6001, "watch"))
        checks = find_checks(name)
        assert checks[name].ok and "paired" in checks[name].detail


@SLOW
def test_hostile_announcements_are_escaped_or_dropped(
    browser: EdgeBrowser, listening: int, request: pytest.FixtureRequest
) -> None:
    name = unique(request)
    good = pack_announcement(Announcement(name, listening, 6001))
    hostile: list[tuple[str, dict[str, Any]]] = [
        ("escape", {**good, "name": f"{name}\x1b[31m\u202e\n"}),
        ("long", {**good, "name": name + 150 * "x"}),
        ("no name", {**good, "name": f"{name}"} | {"control": "99999999999999999999"}),
        ("empty", {}),
        ("bytes", {**good, "characters": b"\xff\xfe"}),
    ]
    with contextlib.closing(zeroconf.Zeroconf(interfaces=LOOPBACK)) as liar:
        for label, properties in hostile:
            service = f"{label} {name}.{SERVICE_TYPE}"[-100:]
            info = zeroconf.ServiceInfo(
                *(SERVICE_TYPE, service),
                port=listening,
                properties=properties,
                parsed_addresses=LOOPBACK,
                server=f"liar-{len(label)}.local.",
            )
            liar.register_service(info, allow_name_change=True)
        with Announcer(Announcement(name + " good", listening, 6001), "127.0.0.1"):
            wait_until(lambda: named(browser, f"{name} good"), "the good edge")
            wait_until(
                lambda: any(edge.service.startswith("escape") for edge in browser.edges), "the escaped one"
            )
    shown = [edge.announcement.name for edge in browser.edges if name in edge.announcement.name]
    assert all(text.isprintable() and len(text) <= 64 for text in shown)
    assert not any(edge.service.startswith(("no name", "empty", "bytes")) for edge in browser.edges)


def test_addresses_on_the_internet_are_not_contacted() -> None:
    assert not any(map(is_on_local_network, ["8.8.8.8", "2001:4860:4860::8888"]))
    near = ["127.0.0.1", "192.168.1.20", "10.0.0.5", "169.254.3.4", "fe80::1%2", "::1"]
    assert all(map(is_on_local_network, near))


def test_number_of_edges_is_limited(browser: EdgeBrowser) -> None:
    class Info:
        port = 5580
        properties: ClassVar = RECORD

        def parsed_scoped_addresses(self) -> list[str]:
            return ["127.0.0.1"]

    class Answers:
        def get_service_info(self, *_: Any, **__: Any) -> Info:
            return Info()

    for number in range(200):
        browser.resolve(Answers(), f"{number}.{SERVICE_TYPE}")
    assert len(browser.edges) <= 64


@given(st.dictionaries(st.binary(max_size=12), st.none() | st.binary(max_size=80), max_size=8), st.integers())
def test_any_text_record_is_read_or_refused(properties: dict[bytes, bytes | None], port: int) -> None:
    base = {k.encode(): v.encode() for k, v in pack_announcement(Announcement("edge", 1, 2)).items()}
    with contextlib.suppress(InputError):
        read = parse_announcement(port, base | properties)
        assert read.name.isprintable() and 0 < read.pose_port < 65536 and 0 < read.control_port < 65536


@given(st.text(max_size=300))
def test_any_name_becomes_a_service_name(name: str) -> None:
    instance = Announcement(name, 1, 2).instance
    assert 0 < len(instance.encode()) <= 60 and "." not in instance and instance.isprintable()


def test_an_announcement_survives() -> None:
    announced = Announcement("stage \u9996", 5580, 5581, True, 3, "10.0.0.5")
    packed = {k.encode(): v.encode() for k, v in pack_announcement(announced).items()}
    assert parse_announcement(5580, packed) == announced


def test_failed_registration_is_only_logged(caplog: pytest.LogCaptureFixture) -> None:
    before = set(threading.enumerate())
    announcer = Announcer(Announcement("edge", 5580, 5581), "192.0.2.77")  # not an address of this machine
    wait_until(lambda: set(threading.enumerate()) <= before, "the end of its thread")
    announcer.close()
    assert any("cannot be announced" in record.getMessage() for record in caplog.records)


def test_loopback_is_not_among_the_announced_addresses() -> None:
    for host in ("0.0.0.0", "::", "*"):
        assert not any(address.startswith("127.") or address == "::1" for address in list_own_addresses(host))
    assert all(":" not in address for address in list_own_addresses("0.0.0.0"))
    assert list_own_addresses("127.0.0.1") == ["127.0.0.1"]


@SLOW
def test_closing_does_not_wait_for_the_network() -> None:
    done: list[bool] = []
    announcer = Announcer(Announcement("edge", 5580, 5581), "127.0.0.1")
    close: Callable[[], None] = lambda: (announcer.close(), done.append(True))[0]  # noqa: E731
    thread = threading.Thread(target=close)
    thread.start()
    thread.join(20.0)
    assert done


def test_address_that_answers_is_used(listening: int) -> None:
    """An edge with several network cards is reachable only by one of its addresses."""
    edge = DiscoveredEdge("edge", Announcement("edge", listening, 6001), ("192.0.2.1", "::1", "127.0.0.1"))
    assert check_edge(edge).endpoint.host == "127.0.0.1"
