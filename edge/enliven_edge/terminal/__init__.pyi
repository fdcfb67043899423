from .protocol_query import image_protocol as image_protocol
from .image_encoding import (
    IMAGE_PROTOCOLS as IMAGE_PROTOCOLS,
    ImageProtocol as ImageProtocol,
    encode_image as encode_image,
)
