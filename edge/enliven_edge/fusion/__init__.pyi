from .settings import CalibrationSettings, FusionSettings

__all__ = ["CalibrationSettings", "FusionSettings"]
