from .puppet_actor import cast_puppet as cast_puppet
from .settings import PuppetSettings as PuppetSettings
from .skin import roughly_skinned as roughly_skinned
from .spec import is_puppet as is_puppet
