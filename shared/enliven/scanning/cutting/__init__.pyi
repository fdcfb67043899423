from .box import CutBox as CutBox, cut_by_box as cut_by_box, upright_frame as upright_frame
from .moved import KnownImage as KnownImage, compared as compared, cut_what_is_new as cut_what_is_new
from .parts import CutOut as CutOut
