"""The workspace: commands, files, input and the project store that the window brings together."""

from enliven_viewer.studio.workspace.command_table import DEEDS
from enliven_viewer.studio.workspace.file_browser import Browser
from enliven_viewer.studio.workspace.go_to import begin_pose, edit_pose
from enliven_viewer.studio.workspace.renaming import renamed
from enliven_viewer.studio.workspace.workspace import Desk

__all__ = ["DEEDS", "Browser", "Desk", "begin_pose", "edit_pose", "renamed"]
