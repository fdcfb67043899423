from .command_table import DEEDS
from .file_browser import Browser
from .go_to import begin_pose, edit_pose
from .renaming import renamed
from .workspace import Desk

__all__ = ["DEEDS", "Browser", "Desk", "begin_pose", "edit_pose", "renamed"]
