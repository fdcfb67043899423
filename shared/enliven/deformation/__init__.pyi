from .skinning import skin_vertices as skin_vertices
from .spheres import (
    SphereProxies as SphereProxies,
    SphereSettings as SphereSettings,
    pack_spheres as pack_spheres,
)
