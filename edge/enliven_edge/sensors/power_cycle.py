"""Resets a USB camera that cannot be opened, although the system lists it.

It works only on Linux, in two ways. A port reset (``USBDEVFS_RESET``) needs the permission to open the
camera. A new connection (``authorized`` in sysfs) needs the permission to write that file. Neither switches
the supply voltage off, which most hubs cannot do.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from pathlib import Path

from enliven_edge.sensors.attached_cameras import (
    ALLOW,
    DEVICES,
    NODES,
    AttachedCamera,
    list_attached,
)

if sys.platform == "linux":
    import fcntl

log = logging.getLogger(__name__)

_USBDEVFS_RESET = ord("U") << 8 | 20
"""The ioctl request in ``<linux/usbdevice_fs.h>`` that resets the port of a device: ``_IO('U', 20)``."""
FIRST_PAUSE_S = 30.0
"""Minimum seconds between the first and the second reset. It is long enough, because a camera takes ten
seconds to start."""
MAX_PAUSE_S = 600.0
"""Maximum seconds between two resets. Each pause is twice as long as the previous one."""
_OFF_S = 1.0
"""Seconds for which a camera stays disconnected."""
RULES_ADVICE = ALLOW.replace("60-enliven-cameras", "61-enliven-power-cycle")
"""Advice for allowing ordinary users to disconnect and connect cameras."""


class CameraPower:
    """Resets the USB cameras of one driver after repeated failures to open one.

    The first, third, ... reset is a port reset, the others are new connections. If one way is not allowed,
    the other is tried.

    Args:
        sensor: name of the driver. Cameras of other drivers are not reset.
        serial: serial number of the camera; empty for all cameras of the driver.
        after: number of consecutive failures before the first reset. If 0, cameras are never reset.
        devices, nodes: the system's list of USB devices, and the device files.

    Attributes:
        count: number of resets.
    """

    def __init__(
        self, sensor: str, serial: str = "", after: int = 0, devices: Path = DEVICES, nodes: Path = NODES
    ) -> None:
        self._sensor, self._serial, self._after = sensor, serial, after
        self._devices, self._nodes = devices, nodes
        self.count = 0
        self._failures = 0
        self._pause_s, self._due_at = FIRST_PAUSE_S, 0.0
        self._has_warned = False

    def record_frame(self) -> None:
        """Records that the camera works."""
        self._failures, self._pause_s = 0, FIRST_PAUSE_S

    def record_failure(self) -> None:
        """Records that the camera could not be opened, or hangs."""
        self._failures += 1

    @property
    def is_due(self) -> bool:
        """Returns True if the next attempt to open the camera should reset it first."""
        return 0 < self._after <= self._failures and time.monotonic() >= self._due_at

    def cycle(self) -> int:
        """Resets the cameras that the system lists, and returns their number. Takes a second."""
        self._failures = 0
        self._due_at = time.monotonic() + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, MAX_PAUSE_S)
        cameras = [camera for camera in list_attached(self._devices, self._nodes) if self._is_meant(camera)]
        return sum(self._reset(camera) for camera in cameras)

    def _is_meant(self, camera: AttachedCamera) -> bool:
        return camera.kind.sensor == self._sensor and (
            not self._serial or self._serial in camera.title.split()
        )

    def _reset(self, camera: AttachedCamera) -> bool:
        """Resets one camera. Returns False if the system does not allow it."""
        methods = [_reset_port, _reconnect] if self.count % 2 == 0 else [_reconnect, _reset_port]
        errors = []
        for method in methods:
            try:
                method(camera)
            except OSError as error:
                errors.append(error)
                continue
            self.count += 1
            log.warning("%s could not be opened several times, so its USB port was reset", camera.title)
            return True
        if not self._has_warned:
            self._has_warned = True
            reason = errors[0].strerror or str(errors[0])
            log.warning("%s hangs and cannot be reset (%s). %s", camera.title, reason, RULES_ADVICE)
        return False


def _reset_port(camera: AttachedCamera) -> None:
    """Resets the camera's port.

    Raises:
        OSError: if the system does not allow it.
    """
    if sys.platform != "linux":
        raise OSError("this system cannot reset USB ports")
    descriptor = os.open(camera.node, os.O_WRONLY | os.O_CLOEXEC)
    try:
        fcntl.ioctl(descriptor, _USBDEVFS_RESET, 0)
    finally:
        os.close(descriptor)


def _reconnect(camera: AttachedCamera) -> None:
    """Disconnects the camera for a second and connects it again. Only the system's view of the camera
    changes.

    Raises:
        OSError: if the system does not allow it. The camera is then connected.
    """
    switch = camera.device / "authorized"
    # Open it without creating it, because the file disappears if the camera was unplugged in the meantime.
    descriptor = os.open(switch, os.O_WRONLY | os.O_CLOEXEC)
    try:
        os.write(descriptor, b"0")
        time.sleep(_OFF_S)
    finally:
        try:
            os.lseek(descriptor, 0, os.SEEK_SET)
            os.write(descriptor, b"1")
        finally:
            os.close(descriptor)
