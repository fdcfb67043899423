"""Opens the OSC port of a sensor. The library that it needs is optional."""

from __future__ import annotations

from enliven.doctor import need
from enliven_edge.sensors.streams.stream_sensor import FramePort, Message


def open_osc_port(kind: str, port: int, host: str) -> FramePort[list[Message]]:
    """Opens the OSC port of a sensor.

    Args:
        kind: the name of the sensor on the command line.
        port: UDP port to listen on.
        host: address to listen on. "0.0.0.0" also accepts other machines.

    Raises:
        InputError: for a wrong port.
        ResourceError: for a port in use, or if python-osc is missing.
    """
    need("pythonosc", "outputs", kind)
    from enliven_edge.sensors.streams.osc_port import OscPort

    return OscPort(host, port, f"sensor {kind}")
