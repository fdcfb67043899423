from .exporting import FILM_SIZES as FILM_SIZES, RATES as RATES, ExportOptions as ExportOptions
from .files import EXPORTS as EXPORTS, SAMPLES as SAMPLES
from .file_browser import ORDERS as ORDERS, FileBrowser as FileBrowser, places as places
from .project_comparison import Difference as Difference
from .workspace import Workspace as Workspace
