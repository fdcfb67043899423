from .libcamera_images import LibcameraImages as LibcameraImages
from .libcamera_library import list_cameras as list_cameras
