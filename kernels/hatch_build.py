"""Build hook: compiled kernels of a folder go into a wheel for this Python version and platform."""

import os
import platform
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FOLDER = "ENLIVEN_KERNELS"
"""Environment variable with the folder of the compiled kernels; without it the wheel is empty."""
MACHINE = "ENLIVEN_KERNELS_MACHINE"
"""Environment variable with the machine of kernels that another machine compiled, such as aarch64."""


class CompiledKernels(BuildHookInterface):
    """Adds the files of the folder that the environment names, and the tag of their platform."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Adds each ``*.kernel`` file and the wheel's tag."""
        folder = os.environ.get(FOLDER)
        if not folder or version == "editable":
            return
        for path in sorted(Path(folder).glob("*.kernel")):
            build_data["force_include"][str(path)] = f"enliven_kernels/kernels/{path.name}"
        build_data["pure_python"] = False
        build_data["tag"] = wheel_tag()


def wheel_tag() -> str:
    """Returns the tag of wheels for this interpreter, this operating system and the kernels' machine."""
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    system = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    if sys.platform == "linux":
        # Machine code of kernels calls nothing of the C library that is newer than Numba's own wheels.
        system = f"manylinux_2_28_{os.environ.get(MACHINE, platform.machine())}"
    return f"{python}-{python}-{system}"
