from .preview_textures import PreviewTextures as PreviewTextures, picture_of as picture_of
from .scan_preview_pass import ScanPreview as ScanPreview
from .viewport import Viewport as Viewport
