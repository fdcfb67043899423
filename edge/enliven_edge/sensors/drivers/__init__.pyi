from .libcamera_images import LibcameraImages
from .libcamera_library import listed_cameras

__all__ = ["LibcameraImages", "listed_cameras"]
