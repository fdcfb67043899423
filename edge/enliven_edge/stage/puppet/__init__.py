"""Meshes moved by a few example poses: performers drive control points, and the surface follows in the
viewer.
"""

from enliven_edge.stage.puppet.casting import cast_puppet
from enliven_edge.stage.puppet.settings import PuppetSettings
from enliven_edge.stage.puppet.skin import roughly_skinned
from enliven_edge.stage.puppet.spec import is_puppet

__all__ = ["PuppetSettings", "cast_puppet", "is_puppet", "roughly_skinned"]
