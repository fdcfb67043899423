"""Sensors whose library may crash or hang: each runs in a helper process, its images in shared memory."""

from enliven_edge.sensors.isolation.isolated import IsolatedOpener

__all__ = ["IsolatedOpener"]
