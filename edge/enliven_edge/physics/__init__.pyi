from .engine import need_engine
from .playground import Playground
from .settings import PhysicsSettings

__all__ = ["PhysicsSettings", "Playground", "need_engine"]
