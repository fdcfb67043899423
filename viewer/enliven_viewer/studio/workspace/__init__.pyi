from .files import SAMPLES as SAMPLES
from .file_browser import FileBrowser as FileBrowser
from .project_comparison import Difference as Difference
from .workspace import Workspace as Workspace
