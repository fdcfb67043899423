"""Characters into a picture: opaque, and transparent where a performer's body is inside them."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

from enliven_viewer.render.capsules import bone_block
from enliven_viewer.render.gl import BLOCKS, UNITS, RenderTarget, load_program, set_uniform
from enliven_viewer.render.scene import Scene
from enliven_viewer.render.skinned import SkinnedMesh
from enliven_viewer.settings import RenderSettings


class MeshPass:
    """Draws the meshes of a scene with the programs that they need, compiled when one first does.

    Args:
        ctx: the renderer's context.
    """

    def __init__(self, ctx: moderngl.Context, settings: RenderSettings) -> None:
        self.ctx, self.settings = ctx, settings
        self._bones = ctx.buffer(reserve=3 * 64 * 16, dynamic=True)
        self._programs: dict[tuple[bool, bool], moderngl.Program] = {}

    def draw(self, picture: RenderTarget, meshes: Sequence[SkinnedMesh], scene: Scene) -> None:
        """Draw them before what the picture shows, which is seen through them where they are transparent."""
        block, count = bone_block(scene.bodies, scene.style.reveal)
        revealing = count > 0 and scene.style.reveal > 0
        if revealing:
            self._bones.write(block.tobytes())
            self._bones.bind_to_uniform_block(BLOCKS["Bones"])
            picture.behind().use(UNITS["picture"])
        self.ctx.depth_func = "<="
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        for mesh in meshes:
            program = self._program(mesh.fine, revealing)
            set_uniform(program, "bone_count", count)
            mesh.render(program)

    def _program(self, fine: bool, revealing: bool) -> moderngl.Program:
        """The program for a mesh that is lit at its vertices or not, and for one that may be transparent."""
        if (fine, revealing) not in self._programs:
            defines = ("FINE",) * fine + ("REVEALING",) * revealing
            program = load_program(self.ctx, "mesh.vert", "mesh.frag", defines=defines)
            set_uniform(program, "reveal_distance", max(self.settings.reveal_distance, 1e-4))
            set_uniform(program, "reveal_opacity", self.settings.reveal_opacity)
            self._programs[fine, revealing] = program
        return self._programs[fine, revealing]
