from .command_table import MENU_COMMANDS as MENU_COMMANDS
from .file_browser import FileBrowser as FileBrowser
from .workspace import Workspace as Workspace
