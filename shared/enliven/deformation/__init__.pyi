from .skinning import skin_vertices
from .spheres import SphereProxies, SphereSettings, pack_spheres

__all__ = ["SphereProxies", "SphereSettings", "pack_spheres", "skin_vertices"]
