"""The user's folders for data and for configuration files."""

from __future__ import annotations

import os
from pathlib import Path


def user_data_folder() -> Path:
    """Returns the user's folder for data that programs store between runs."""
    configured = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(configured) if configured else Path.home() / ".local" / "state") / "enliven"


def config_folder() -> Path:
    """Returns the user's folder for configuration files, such as keys."""
    folder_name = os.environ.get("XDG_CONFIG_HOME") or os.environ.get("APPDATA")
    return (Path(folder_name) if folder_name else Path.home() / ".config") / "enliven"
