from .casting import cast_puppet as cast_puppet, cast_from_project as cast_from_project
from .settings import PuppetSettings as PuppetSettings
from .skin import roughly_skinned as roughly_skinned
from .spec import is_puppet as is_puppet
