from .output import Output as Output, mirror_of as mirror_of
from .surfaces import mirrored_surfaces as mirrored_surfaces, seen_surfaces as seen_surfaces
