"""Build hooks of this package: siblings of the same version."""

from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface


class SiblingVersions(MetadataHookInterface):
    """Requires the other enliven packages in this package's own version: they share inner modules."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Adds the dependencies of pyproject.toml, those called enliven or enliven-... with this version."""
        metadata["dependencies"] = [
            f"{line}=={metadata['version']}" if line.startswith("enliven") else line
            for line in self.config["dependencies"]
        ]
