"""Finds missing requirements for the installation of a kiosk."""

from __future__ import annotations

import os
import shutil
import stat
import sys
from pathlib import Path

from enliven.errors import EnlivenError, ResourceError


def find_lacks(root: Path, python: str = sys.executable) -> list[EnlivenError]:
    """Returns an error for each missing requirement of an installation: root rights, systemd, cage, seatd, a
    readable Python.

    Args:
        root: root folder of the system that is changed. "/" is the running system.
        python: path of the Python interpreter with which enliven is installed.
    """
    problems: list[EnlivenError] = []
    is_running = root == Path("/")
    if is_running and os.geteuid() != 0:
        remedy = "Run: sudo enliven install-kiosk PROFILE"
        problems.append(ResourceError("only root can install services", remedy=remedy))
    if is_running and not Path("/run/systemd/system").is_dir():
        remedy = "Run: enliven kiosk PROFILE. This command supervises the programs without systemd."
        problems.append(ResourceError("this computer does not run systemd", remedy=remedy))
    for program, use in (("cage", "shows the window"), ("seatd", "gives the window access to the screen")):
        if find_program(program, root) is None:
            remedy = f"Run: sudo apt-get install {program}"
            problems.append(ResourceError(f"the program {program} is missing, which {use}", remedy=remedy))
    if is_running:
        problems += _find_unreadable(Path(python))
    return problems


def find_program(name: str, root: Path) -> str | None:
    """Returns the path of a program in a system, or None."""
    folders = [str(root / folder) for folder in ("usr/bin", "usr/sbin", "usr/local/bin", "bin", "sbin")]
    path = shutil.which(name, path=os.pathsep.join(folders))
    return None if path is None else "/" + str(Path(path).relative_to(root))


def _find_unreadable(python: Path) -> list[EnlivenError]:
    """Returns an error if other users cannot run the Python interpreter."""
    for folder in python.parents:
        if not stat.S_IMODE(folder.stat().st_mode) & stat.S_IXOTH:
            remedy = (
                "Create an environment in another folder: python3 -m venv /opt/enliven. Install enliven "
                "there."
            )
            return [
                ResourceError(
                    "the kiosk's user cannot run this Python interpreter", where=str(python), remedy=remedy
                )
            ]
    return []
