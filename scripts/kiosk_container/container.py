"""A container that runs systemd like a small computer.

It controls power, disk and screen, and runs commands inside.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import struct
import subprocess
import time
from pathlib import Path

STATE = Path("var/lib/enliven")
"""Mount point of the container's partition for all that the kiosk writes."""
_BOOT_TIMEOUT_S = 60.0
"""Maximum seconds until systemd runs, on a busy machine."""
_UNMOUNT_TIMEOUT_S = 60.0
"""Maximum seconds until the kernel has unmounted the partition."""
_EXT4_IOC_SHUTDOWN = 0x8004587D
"""Number of the ioctl that stops an ext4 file system (linux/fs/ext4/ext4.h, _IOR('X', 125, __u32))."""
_NO_LOG_FLUSH = 2
"""Flag of this ioctl. The file system stops immediately and loses unwritten data, as in a power cut. Linux
tests its file systems like this."""
_SCREENSHOT = "var/tmp/screen.png"
"""Path of a screenshot inside the container."""


class Container:
    """A container that runs systemd.

    Args:
        root: folder with the container's root file system.
        disk: image of the partition for :data:`STATE`. A simulated power cut damages it like a real one.
    """

    def __init__(self, root: Path, disk: Path) -> None:
        self._root, self._disk = root, disk
        state = root / STATE
        state.mkdir(parents=True, exist_ok=True)
        subprocess.run(["mount", "-o", "loop", str(disk), str(state)], check=True)
        self._boot = subprocess.Popen(["sh", str(Path(__file__).with_name("boot")), str(root)])
        self._init = 0

    def run(self, command: str, timeout_s: float = 120.0) -> str:
        """Runs a command as root, and returns its output.

        Raises:
            RuntimeError: if it fails.
        """
        done = self.try_run(command, timeout_s)
        if done.returncode:
            raise RuntimeError(f"in the container, {command!r} failed: {done.stdout}{done.stderr}")
        return done.stdout

    def try_run(self, command: str, timeout_s: float = 120.0) -> subprocess.CompletedProcess[str]:
        """Runs a command as root."""
        words = ["nsenter", "--target", str(self.wait_for_init()), "--all", "env", "-i", "HOME=/root"]
        words += ["PATH=/opt/venv/bin:/usr/sbin:/usr/bin:/sbin:/bin", "LANG=C.UTF-8", "sh", "-c", command]
        return subprocess.run(words, capture_output=True, text=True, timeout=timeout_s, check=False)

    def wait_for_init(self) -> int:
        """Waits until systemd runs, and returns its process id.

        Raises:
            TimeoutError: if systemd does not start.
        """
        deadline = time.monotonic() + _BOOT_TIMEOUT_S
        children = Path(f"/proc/{self._boot.pid}/task/{self._boot.pid}/children")
        while not self._init:
            with contextlib.suppress(OSError, ValueError, IndexError):
                child = int(children.read_text().split()[0])
                if Path(f"/proc/{child}/comm").read_text() == "systemd\n":
                    self._init = child
            if time.monotonic() > deadline or self._boot.poll() is not None:
                raise TimeoutError("systemd does not start in the container")
            time.sleep(0.02)
        return self._init

    def screenshot(self, path: Path) -> None:
        """Writes a PNG image of the container's screen."""
        user = "runuser -u enliven -- env XDG_RUNTIME_DIR=/run/enliven WAYLAND_DISPLAY=wayland-0"
        self.run(f"{user} grim /{_SCREENSHOT}")
        path.write_bytes((self._root / _SCREENSHOT).read_bytes())

    def read_edge_figures(self) -> dict[str, float]:
        """Returns the newest measurements of the edge, at most a second old.

        The result is empty at first.
        """
        record = Path(f"/proc/{self.wait_for_init()}/root/run/enliven/services/edge.json")
        try:
            return json.loads(record.read_bytes())["figures"]
        except (OSError, ValueError, KeyError):
            return {}

    def recorded_bytes(self) -> int:
        """Returns the size of all recordings on the partition in bytes."""
        total = 0
        for path in (self._root / STATE / "recordings").glob("*.mcap"):
            # The edge deletes its oldest recordings when the disk is full.
            with contextlib.suppress(FileNotFoundError):
                total += path.stat().st_size
        return total

    def cut_power(self) -> float:
        """Stops the disk, and then all programs immediately. Returns the Unix time."""
        descriptor = os.open(self._root / STATE, os.O_RDONLY)
        try:
            cut_s = time.time()
            fcntl.ioctl(descriptor, _EXT4_IOC_SHUTDOWN, struct.pack("I", _NO_LOG_FLUSH))
        finally:
            os.close(descriptor)
        self.close()
        return cut_s

    def close(self) -> None:
        """Ends all programs, and unmounts the partition.

        Raises:
            TimeoutError: if a program still uses the partition.
        """
        self._boot.kill()
        self._boot.wait()
        deadline = time.monotonic() + _UNMOUNT_TIMEOUT_S
        # The kernel unmounts the container's own mounts some time after its processes end. If the disk were
        # mounted again before, it would be the stopped file system.
        while self._is_attached():
            subprocess.run(["umount", str(self._root / STATE)], capture_output=True, check=False)
            if time.monotonic() > deadline:
                raise TimeoutError(f"{self._disk} is still in use")
            time.sleep(0.1)

    def _is_attached(self) -> bool:
        """Returns True while the partition is mounted anywhere."""
        words = ["losetup", "--associated", str(self._disk)]
        return bool(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
