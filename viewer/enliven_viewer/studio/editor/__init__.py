"""The editor without a window: the project with its past, time, camera and selection."""

from enliven_viewer.studio.editor.editor import Edit, Editor

__all__ = ["Edit", "Editor"]
