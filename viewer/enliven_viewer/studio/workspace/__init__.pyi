from .command_table import MENU_COMMANDS
from .file_browser import FileBrowser
from .go_to import begin_pose, edit_pose
from .workspace import Workspace

__all__ = ["MENU_COMMANDS", "FileBrowser", "Workspace", "begin_pose", "edit_pose"]
