"""Tests of the viewer with edges found on the network: the list, and the camera images."""

from __future__ import annotations

import contextlib
import socket
import uuid

import pytest
from patience import wait_until

from enliven.peers.announcement import Announcement
from enliven.peers.announcer import Announcer
from enliven.peers.edge_browser import EdgeBrowser
from enliven.wire import CameraMessage, free_ports
from enliven_edge.network.publisher import Publisher
from enliven_viewer.commands.view import list_network_edges
from enliven_viewer.link.camera_glance import CameraGlance
from enliven_viewer.link.edge_search import EdgeSearch

pytest.importorskip("zeroconf")


@pytest.mark.slow
def test_view_lists_the_edges_of_the_network_if_none_runs_here(capsys: pytest.CaptureFixture[str]) -> None:
    name = uuid.uuid4().hex
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with Announcer(Announcement(name, port, 6001, characters=3), "127.0.0.1") as announcer:
            wait_until(lambda: announcer.name, "its registration")
            (silent,) = free_ports(1)
            assert list_network_edges(f"127.0.0.1:{silent}")
            shown = capsys.readouterr().out
            assert f"{name}: 127.0.0.1:{port}:6001, 3 characters, no keys" in shown
            assert "--edge ADDRESS" in shown
            assert not list_network_edges(f"127.0.0.1:{port}"), "an edge runs on this machine"


def test_camera_image_of_an_edge_is_received() -> None:
    with Publisher(name=uuid.uuid4().hex, pose_port=0, control_port=0) as edge:
        glance = CameraGlance(edge.endpoint)
        camera = CameraMessage([0.0] * 12, [1.0, 1.0, 0.5, 0.5], 2, 2, b"\0\1\2\3")

        def is_received() -> bool:
            edge.publish(camera)
            edge.poll()
            glance.poll()
            return glance.camera is not None

        with contextlib.closing(glance):
            wait_until(is_received, "its image")
            assert glance.camera == camera
            assert edge.viewers == 0, "a list is not a viewer"


@pytest.mark.slow
def test_search_shows_the_camera_of_a_found_edge(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search, the check of the address and the camera image work together."""
    monkeypatch.setattr("enliven_viewer.link.edge_search.EdgeBrowser", lambda: EdgeBrowser(["127.0.0.1"]))
    name = uuid.uuid4().hex
    with Publisher(name=name, pose_port=0, control_port=0) as edge:
        ports = edge.endpoint.pose_port, edge.endpoint.control_port
        search = EdgeSearch()
        with Announcer(Announcement(name, *ports), "127.0.0.1"), contextlib.closing(search):

            def has_image() -> bool:
                edge.publish(CameraMessage([0.0] * 12, [1.0, 1.0, 0.5, 0.5], 2, 2, b"\0\1\2\3"))
                edge.poll()
                search.poll()
                ours = [edge for edge in search.edges if edge.announcement.name == name]
                return bool(ours) and search.camera(ours[0]) is not None

            wait_until(has_image, "its image")
