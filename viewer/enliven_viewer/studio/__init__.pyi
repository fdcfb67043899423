from .settings import StudioSettings as StudioSettings
from .window import StudioWindow as StudioWindow
