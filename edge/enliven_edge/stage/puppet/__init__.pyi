from .puppet_actor import cast_puppet as cast_puppet
from .settings import PuppetSettings as PuppetSettings
from .spec import is_puppet as is_puppet
