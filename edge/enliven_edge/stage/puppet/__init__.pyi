from .puppet_setup import (
    create_actor_from_project as create_actor_from_project,
    create_puppet_actor as create_puppet_actor,
)
from .settings import PuppetSettings as PuppetSettings
from .spec import is_puppet as is_puppet
