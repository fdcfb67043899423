from .output import Output as Output, mirror_plane as mirror_plane
from .surfaces import mirror_surfaces as mirror_surfaces, visible_surfaces as visible_surfaces
