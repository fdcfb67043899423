from .puppet_setup import cast_from_project as cast_from_project, cast_puppet as cast_puppet
from .settings import PuppetSettings as PuppetSettings
from .spec import is_puppet as is_puppet
