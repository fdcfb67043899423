"""The room and the depth camera before which the performer stands, with the faults of real cameras."""

from enliven_synthesis.sensor.noise import DepthNoise
from enliven_synthesis.sensor.render import Renderer
from enliven_synthesis.sensor.studio import Studio, StudioSettings

__all__ = ["DepthNoise", "Renderer", "Studio", "StudioSettings"]
