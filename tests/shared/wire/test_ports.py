"""Tests of choosing ports for programs that are started together."""

import socket
import sys
from pathlib import Path

import pytest

from enliven.errors import ResourceError
from enliven.wire import free_ports
from enliven.wire import ports as ports_module


@pytest.mark.skipif(sys.platform != "linux", reason="reads the range of clients' ports from /proc")
def test_ports_are_not_given_to_clients():
    low = int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split()[0])
    ports = free_ports(40)
    assert len(set(ports)) == 40 and (max(ports) < low or low <= ports_module.PORTS[0])


def test_taken_ports_are_passed_over_and_too_few_are_reported(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as server:
        taken = server.getsockname()[1]
        monkeypatch.setattr(ports_module, "PORTS", range(taken, taken + 1))
        with pytest.raises(ResourceError, match=f"fewer than 1 ports from {taken}"):
            free_ports(1)
