from .libcamera_images import LibcameraImages

__all__ = ["LibcameraImages"]
