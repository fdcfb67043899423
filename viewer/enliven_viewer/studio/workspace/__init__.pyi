from .files import SAMPLES as SAMPLES
from .file_browser import FileBrowser as FileBrowser
from .workspace import Workspace as Workspace
