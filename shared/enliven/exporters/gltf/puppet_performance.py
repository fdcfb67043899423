"""A puppet's performance, baked as transforms or morph targets for programs that cannot solve its surface.

write_gltf("out.glb", [puppet_performance_of(project, "cactus")])
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.arrays import Float
from enliven.document import Project
from enliven.examples.baking import (
    BakedMorphs,
    BakedSurface,
    BakeError,
    BakeSettings,
    SurfaceFrames,
    bake_morphs,
    bake_surface,
    states_of,
)
from enliven.meshes import Mesh
from enliven.modeling.puppet import frame_times


@dataclass(frozen=True, eq=False)
class PuppetPerformance:
    """A puppet's mesh with its baked motion.

    Attributes:
        name: the puppet's.
        mesh: at rest, in its own frame.
        times: (T,) seconds, rising, from 0.
        turns, places: (T, 4) and (T, 3), where the mesh's frame is in the world: x is at turn x + place.
        surface: the transforms or the morph targets, in the mesh's frame.
        keys: metres that leaving out keys may add to the error.
    """

    name: str
    mesh: Mesh
    times: Float
    turns: Float
    places: Float
    surface: BakedSurface | BakedMorphs
    keys: float

    @property
    def error(self) -> BakeError:
        """Metres: how far the baked surface is from the solved one at the frames, before keys are left
        out."""
        return self.surface.error


def puppet_performance_of(
    project: Project,
    name: str,
    start: float = 0.0,
    end: float | None = None,
    rate: float = 30.0,
    *,
    how: Literal["skin", "morphs"] = "skin",
    settings: BakeSettings | None = None,
) -> PuppetPerformance:
    """Bakes a puppet of a project from ``start`` to ``end`` seconds at ``rate`` frames a second.

    Args:
        end: None takes the end of the last of its layers.
        how: transforms that vertices follow, or morph targets.
        settings: how closely.

    Raises:
        InputError: where there is no such puppet, the times make no sense, or it lacks something to move.
    """
    settings = settings or BakeSettings()
    puppet = project.puppet(name)
    times = frame_times(start, project.end_of(puppet) if end is None else end, rate, name)
    places, turn, place = states_of(project, puppet, times)
    frames = SurfaceFrames(puppet, places, settings.kept)
    surface: BakedSurface | BakedMorphs
    if how == "morphs":
        surface = bake_morphs(puppet.mesh, frames, places, settings)
    else:
        held = [point.vertex for point in puppet.points]
        surface = bake_surface(puppet.mesh, frames, places, held, settings)
    keys = settings.keys * surface.error.size
    return PuppetPerformance(name, puppet.mesh, times - start, turn, place, surface, keys)
