from .probing import image_protocol
from .showing import WAYS, Way, encoded_picture

__all__ = ["WAYS", "Way", "encoded_picture", "image_protocol"]
