from .probing import image_protocol as image_protocol
from .showing import WAYS as WAYS, Way as Way, encoded_picture as encoded_picture
