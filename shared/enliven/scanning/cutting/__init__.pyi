from .box import CutBox as CutBox, cut_by_box as cut_by_box, upright_frame as upright_frame
from .moved import (
    KnownImage as KnownImage,
    compare_with_images as compare_with_images,
    cut_new_object as cut_new_object,
)
from .parts import CutOut as CutOut
