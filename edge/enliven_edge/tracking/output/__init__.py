"""What leaves the tracker: joints smoothed, limited in speed, kept on the floor and predicted by
the delay.
"""

from enliven_edge.tracking.output.output import Output, mirror_of
from enliven_edge.tracking.output.surfaces import mirrored_surfaces, seen_surfaces

__all__ = ["Output", "mirror_of", "mirrored_surfaces", "seen_surfaces"]
