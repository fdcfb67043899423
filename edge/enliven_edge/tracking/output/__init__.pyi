from .output import Output, mirror_of
from .surfaces import mirrored_surfaces, seen_surfaces

__all__ = ["Output", "mirror_of", "mirrored_surfaces", "seen_surfaces"]
