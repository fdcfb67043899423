from .preview_textures import PreviewTextures as PreviewTextures, draw_depth_image as draw_depth_image
from .scan_preview_pass import ScanPreview as ScanPreview
from .viewport import Viewport as Viewport
