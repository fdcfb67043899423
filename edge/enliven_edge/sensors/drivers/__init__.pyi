from .libcamera_images import LibcameraImages as LibcameraImages
from .libcamera_library import listed_cameras as listed_cameras
