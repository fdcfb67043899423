"""Determines the file system of a folder, and whether its files survive a power cut (Linux)."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path

_VOLATILE_KINDS = frozenset({"tmpfs", "ramfs", "overlay", "aufs"})
"""Types of file systems in memory. An overlay over a read-only root (overlayroot) also keeps changes in
memory."""


@dataclass(frozen=True)
class Mount:
    """A mounted file system.

    Attributes:
        place: mount point of the file system.
        kind: type of the file system, such as ext4.
        is_read_only: True if the file system cannot be written.
    """

    place: Path
    kind: str
    is_read_only: bool

    @property
    def is_volatile(self) -> bool:
        """True if its files are lost at power off."""
        return self.kind in _VOLATILE_KINDS


def find_mount(path: Path, table: Path = Path("/proc/self/mounts")) -> Mount | None:
    """Returns the file system that contains a path, or None on systems without a table of mounts."""
    mounts: dict[Path, Mount] = {}
    with contextlib.suppress(OSError):
        for line in table.read_text(errors="replace").splitlines():
            _, place, kind, options = line.split(" ")[:4]
            # The kernel writes a space in a path as its octal code.
            folder = Path(place.replace("\\040", " "))
            mounts[folder] = Mount(folder, kind, "ro" in options.split(","))
    resolved = path.resolve()
    return next((mounts[folder] for folder in (resolved, *resolved.parents) if folder in mounts), None)
