from .command_table import MENU_COMMANDS as MENU_COMMANDS
from .file_browser import FileBrowser as FileBrowser
from .go_to import begin_pose as begin_pose, edit_pose as edit_pose
from .workspace import Workspace as Workspace
