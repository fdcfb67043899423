from .settings import CalibrationSettings as CalibrationSettings, FusionSettings as FusionSettings
