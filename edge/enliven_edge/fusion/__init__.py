"""Several sensors on one space: where each stands, and one set of bodies out of what all see."""

from enliven_edge.fusion.settings import CalibrationSettings, FusionSettings

__all__ = ["CalibrationSettings", "FusionSettings"]
