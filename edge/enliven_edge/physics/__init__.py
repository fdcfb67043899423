"""Loose boxes and balls that characters and performers knock about, by a physics engine (an extra)."""

from enliven_edge.physics.engine import need_engine
from enliven_edge.physics.playground import Playground
from enliven_edge.physics.settings import PhysicsSettings

__all__ = ["PhysicsSettings", "Playground", "need_engine"]
