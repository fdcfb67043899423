"""Build hooks of this package: siblings of the same version, and the files of firmware_configs."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

NAME = "firmware_configs"


class FirmwareConfigs(BuildHookInterface):
    """Puts firmware_configs into the wheel and the sdist: in a checkout it lies next to the packages."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Takes the folder next to the package's, or, in an unpacked sdist, the one inside it."""
        root = Path(self.root)
        folder = next(at / NAME for at in (root, root.parent) if (at / NAME).is_dir())
        target = NAME if self.target_name == "sdist" else f"enliven_edge/{NAME}"
        if version != "editable":
            build_data["force_include"][str(folder)] = target


class SiblingVersions(MetadataHookInterface):
    """Requires the other enliven packages in this package's own version: they share inner modules."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Adds the dependencies of pyproject.toml, those called enliven or enliven-... with this version."""
        metadata["dependencies"] = [
            f"{line}=={metadata['version']}" if line.startswith("enliven") else line
            for line in self.config["dependencies"]
        ]
