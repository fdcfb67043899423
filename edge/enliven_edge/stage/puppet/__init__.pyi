from .casting import cast_puppet
from .settings import PuppetSettings
from .skin import roughly_skinned
from .spec import is_puppet

__all__ = ["PuppetSettings", "cast_puppet", "is_puppet", "roughly_skinned"]
