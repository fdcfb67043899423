"""Draws meshes: opaque, with alpha masks, transparent, and with cutaways around a performer inside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import moderngl
import numpy as np

from enliven.arrays import Float
from enliven_viewer.render.capsules import make_bone_block
from enliven_viewer.render.gl.program import BLOCK_BINDINGS, TEXTURE_UNITS, load_program, set_uniform
from enliven_viewer.render.gl.targets import RenderTarget
from enliven_viewer.render.scene import Scene
from enliven_viewer.render.skinned_mesh import DrawnPart, SkinnedMesh
from enliven_viewer.settings import RenderSettings

_REVEAL_DISTANCE_M = 0.10
"""Distance in metres from the performer's body within which the mesh is transparent, so that the body is
visible.
"""
ALPHA_TO_COVERAGE = 0x809E
"""GL_SAMPLE_ALPHA_TO_COVERAGE, which moderngl does not name."""

_OUTLINE_WIDTH = 0.0056
"""Width of the outline around attached parts, as a fraction of the image height: four pixels of 720."""


class MeshPass:
    """The render pass of a scene's meshes.

    The required shader programs are compiled on first use.

    Args:
        ctx: the renderer's context.
    """

    def __init__(self, ctx: moderngl.Context, settings: RenderSettings) -> None:
        self.ctx, self.settings = ctx, settings
        self._bones = ctx.buffer(reserve=3 * 64 * 16, dynamic=True)
        self.height = 1
        self._programs: dict[tuple[str, tuple[str, ...]], moderngl.Program] = {}

    def draw(self, picture: RenderTarget, meshes: Sequence[SkinnedMesh], scene: Scene, eye: Float) -> None:
        """Draws meshes over the existing image, which stays visible through transparent parts.

        Args:
            eye: (3,) metres, camera position. Transparent meshes are drawn from the farthest to the nearest.
        """
        self.height = picture.size[1]
        block, count = make_bone_block(scene.bodies, scene.style.reveal)
        revealing = count > 0 and scene.style.reveal > 0
        if revealing:
            self._bones.write(block.tobytes())
            self._bones.bind_to_uniform_block(BLOCK_BINDINGS["Bones"])
            picture.copy_as_texture().use(TEXTURE_UNITS["picture"])
        self.ctx.depth_func = "<="
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        transparent_parts = list[tuple[SkinnedMesh, DrawnPart]]()
        for mesh in meshes:
            for drawn_part in mesh.parts:
                if drawn_part.part.alpha == "BLEND":
                    transparent_parts.append((mesh, drawn_part))
                else:
                    self._draw_part(mesh, drawn_part, revealing, count)
        for mesh in meshes:
            if mesh.held:
                self._draw_outline(mesh)
        if transparent_parts:
            transparent_parts.sort(key=lambda entry: -float(np.linalg.norm(entry[0].hull().mean(0) - eye)))
            self._draw_clear(picture, transparent_parts, revealing, count)

    def cast(self, meshes: Sequence[SkinnedMesh], clip_from_world: Float) -> None:
        """Draws the shadows of parts with alpha masks or transparency. The shadows of opaque parts are
        already drawn.
        """
        for mesh in meshes:
            for drawn_part in mesh.parts:
                if drawn_part.part.alpha != "OPAQUE":
                    program = self._get_program("caster", ("CUT", *drawn_part.part.shadow_defines))
                    program["clip_from_caster"] = tuple(clip_from_world.T.astype("f4").ravel())
                    self._render(mesh, drawn_part, program)

    def _draw_outline(self, mesh: SkinnedMesh) -> None:
        """Draws an outline around the attached parts of a mesh."""
        program = self._get_program("grip", ())
        program["pixels"] = max(_OUTLINE_WIDTH * self.height, 1.0)
        mesh.bind_glow()
        self.ctx.enable(moderngl.CULL_FACE | moderngl.BLEND)
        self.ctx.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        self.ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self.ctx.cull_face = "front"
        for drawn_part in mesh.parts:
            if drawn_part.part.alpha == "OPAQUE":
                mesh.render(program, drawn_part)
        self.ctx.cull_face = "back"
        self.ctx.disable(moderngl.CULL_FACE | moderngl.BLEND)

    def _draw_part(self, mesh: SkinnedMesh, drawn_part: DrawnPart, revealing: bool, count: int) -> None:
        part = drawn_part.part
        defines = ("FINE",) * (revealing and mesh.fine) + ("REVEALING",) * revealing + ("HELD",) * mesh.held
        if mesh.held:
            mesh.bind_glow()
        program = self._get_program("mesh", (*defines, *part.defines))
        set_uniform(program, "bone_count", count)
        set_uniform(program, "normal_scale", part.normal_scale)
        set_uniform(program, "occlusion_strength", part.occlusion_strength)
        culled = not part.double_sided or (mesh.closed and part.alpha == "OPAQUE")
        (self.ctx.enable if culled else self.ctx.disable)(moderngl.CULL_FACE)
        if part.alpha == "MASK":
            self.ctx.enable_direct(ALPHA_TO_COVERAGE)
        self._render(mesh, drawn_part, program)
        if part.alpha == "MASK":
            self.ctx.disable_direct(ALPHA_TO_COVERAGE)

    def _draw_clear(
        self,
        picture: RenderTarget,
        transparent_parts: Sequence[tuple[SkinnedMesh, DrawnPart]],
        revealing: bool,
        count: int,
    ) -> None:
        """Blends transparent parts over the image. For double-sided parts, back faces are drawn first."""
        self.ctx.enable(moderngl.BLEND)
        self.ctx.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        self.ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        picture.write_depth(False)
        for mesh, drawn_part in transparent_parts:
            if drawn_part.part.double_sided:
                self.ctx.cull_face = "front"
                one_sided = drawn_part._replace(part=replace(drawn_part.part, double_sided=False))
                self._draw_part(mesh, one_sided, revealing, count)
                self.ctx.cull_face = "back"
                self._draw_part(mesh, one_sided, revealing, count)
            else:
                self._draw_part(mesh, drawn_part, revealing, count)
        picture.write_depth(True)
        self.ctx.disable(moderngl.BLEND)

    def _render(self, mesh: SkinnedMesh, drawn_part: DrawnPart, program: moderngl.Program) -> None:
        """Draws a part with its textures."""
        for name, texture in drawn_part.textures.items():
            texture.texture.use(TEXTURE_UNITS[f"{name}_map"])
        set_uniform(program, "cutoff", drawn_part.part.cutoff)
        mesh.render(program, drawn_part)

    def _get_program(self, name: str, defines: tuple[str, ...]) -> moderngl.Program:
        """Returns the program of two shaders with these defines. Each program is compiled once."""
        if (name, defines) not in self._programs:
            program = load_program(self.ctx, f"{name}.vert", f"{name}.frag", defines=defines)
            set_uniform(program, "reveal_distance", _REVEAL_DISTANCE_M)
            set_uniform(program, "reveal_opacity", self.settings.reveal_opacity)
            self._programs[name, defines] = program
        return self._programs[name, defines]
