"""The stage: characters that performers take hold of, drive and let go, frame by frame.

:class:`Stage` holds an actor for each character; this room has the actor of a possessed mesh, ``rig`` that
of a rigged model, ``puppet`` that of a mesh moved by example poses.
"""

from enliven_edge.stage.actor import Actor
from enliven_edge.stage.actor_settings import ActorSettings
from enliven_edge.stage.casting import cast, parts_for
from enliven_edge.stage.highlights import Cues
from enliven_edge.stage.opening import Opening
from enliven_edge.stage.placement import facing
from enliven_edge.stage.stage import Stage

__all__ = ["Actor", "ActorSettings", "Cues", "Opening", "Stage", "cast", "facing", "parts_for"]
