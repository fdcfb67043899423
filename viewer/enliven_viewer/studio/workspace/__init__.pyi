from .exporting import FILM_SIZES as FILM_SIZES, FRAME_RATES as FRAME_RATES, ExportOptions as ExportOptions
from .files import EXPORT_SUFFIXES as EXPORT_SUFFIXES, SAMPLES as SAMPLES
from .file_browser import ORDER_LABELS as ORDER_LABELS, FileBrowser as FileBrowser, list_places as list_places
from .project_comparison import Difference as Difference
from .workspace import Workspace as Workspace
