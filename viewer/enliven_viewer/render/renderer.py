"""Draws an image of a scene: skinning, shadows, floor, bodies, meshes and marks, in this order."""

from __future__ import annotations

import math

import moderngl
import numpy as np

from enliven.arrays import Float, UInt8
from enliven_viewer.render.attachment_glow import compute_node_glow
from enliven_viewer.render.camera import Box, CameraView
from enliven_viewer.render.capsules import CapsulePass, make_capsule_rows
from enliven_viewer.render.drawn_regions import (
    find_mark_points,
    find_shadow_bounds,
    find_shadow_casters,
    find_visible_region,
)
from enliven_viewer.render.gl.program import BLOCK_BINDINGS, TEXTURE_UNITS, load_program, set_uniform
from enliven_viewer.render.gl.targets import RenderTarget, Size, SoftMap, count_spread_texels
from enliven_viewer.render.ground import STAGE_RADIUS, GroundPass, Patch
from enliven_viewer.render.lights import contact_from_world, light_from_world
from enliven_viewer.render.materials.textures import Textures
from enliven_viewer.render.mesh_pass import ALPHA_TO_COVERAGE, MeshPass
from enliven_viewer.render.overlay.marks import Marks
from enliven_viewer.render.overlay.match_lines import find_limb_tints, make_match_rows
from enliven_viewer.render.overlay.tubes import Tubes
from enliven_viewer.render.props import PropPass
from enliven_viewer.render.scene import Scene
from enliven_viewer.render.skinned_mesh import SkinnedMesh
from enliven_viewer.render.stage_look import LOOKS, find_key_direction, make_look_rows
from enliven_viewer.settings import RenderSettings

_CREASE_ANGLE_RAD = math.radians(45.0)
"""Edges with a larger angle than this, in radians, are shaded sharp, others smooth. So boxes look sharp and
round parts smooth.
"""
EMPTY_BOX: Box = (np.array([-0.6, 0.0, -0.6]), np.array([0.6, 1.7, 0.6]))
"""The box that camera and light are aimed at while the scene is empty."""
_SHADOW_BLUR = (2.0,)
"""Distance in texels between the taps of the key light's shadow blur. It gives a soft edge without visible
steps.
"""
_CONTACT_BLUR = (1.0, 2.2)
"""Distances in texels between the taps of the contact map's two blurs. Together they blur over some
decimetres.
"""
_FRAME_BYTES = 4 * (4 * 16 + 11 * 4)
"""Size in bytes of the uniform block Frame: four matrices and eleven vectors of float32."""


class Renderer:
    """A renderer of scenes with one OpenGL context, in a window or off-screen.

    Args:
        ctx: an OpenGL 3.3 core context that is current in this thread.
        size: width and height of the image in pixels.
    """

    def __init__(self, ctx: moderngl.Context, size: Size, settings: RenderSettings | None = None) -> None:
        self.ctx = ctx
        self.settings = settings or RenderSettings()
        self.look = self.settings.look
        self.picture = RenderTarget(ctx, size, self.settings.samples)
        self._shadow = SoftMap(ctx, self.settings.shadow_size)
        self._contact = SoftMap(ctx, self.settings.contact_size)
        self._frame = ctx.buffer(reserve=_FRAME_BYTES, dynamic=True)
        self._skin = load_program(ctx, "skin.vert", varyings=("out_position", "out_normal"))
        self._mesh_pass = MeshPass(ctx, self.settings)
        self.textures = Textures(ctx, self.settings.texture_size)
        self._caster = load_program(ctx, "caster.vert", "caster.frag")
        self._to_key = find_key_direction(self.settings)
        self._body = load_program(ctx, "capsule.vert", "capsule.frag")
        self._body_caster = load_program(ctx, "capsule.vert", "caster.frag")
        self._capsules = CapsulePass(ctx, self._body, open_limbs=True)
        self._shadow_capsules = CapsulePass(ctx, self._body_caster, open_limbs=True, casting=True)
        self._prop = load_program(ctx, "prop.vert", "prop.frag")
        self._prop_caster = load_program(ctx, "prop.vert", "caster.frag")
        self._props, self._shadow_props = PropPass(ctx, self._prop), PropPass(ctx, self._prop_caster)
        self._marks = Marks(ctx)
        self._tubes: Tubes | None = None
        self._present = load_program(ctx, "screen.vert", "present.frag")
        self._present_quad = ctx.vertex_array(self._present, [])
        self._ground = GroundPass(ctx)
        self._meshes: dict[str, SkinnedMesh] = {}
        self._stage: Float | None = None

    @property
    def size(self) -> Size:
        """Returns width and height of the image in pixels."""
        return self.picture.size

    def resize(self, size: Size) -> None:
        """Changes the image size. Sizes without a pixel are ignored (a minimised window)."""
        if size != self.picture.size and size[0] > 0 and size[1] > 0:
            old_picture, self.picture = self.picture, RenderTarget(self.ctx, size, self.settings.samples)
            # use() binds the previous framebuffer once more. So release the previous framebuffer only after
            # use().
            self.picture.drawn.use()
            old_picture.release()

    def draw(self, scene: Scene, view: CameraView) -> None:
        """Draws a scene into :attr:`picture`, and resolves it."""
        self.textures.upload_decoded()
        meshes = self.prepare_meshes(scene)
        box = scene.lit_box or EMPTY_BOX
        stage = self._write_frame(box, view)
        bodies = scene.bodies if scene.style.body > 0 else ()
        capsules = make_capsule_rows(bodies, scene.style.body, find_limb_tints(scene.boards))
        self._capsules.load(capsules)
        self._shadow_capsules.load(capsules)
        self._props.load(scene.props)
        self._shadow_props.load(scene.props)
        casters = find_shadow_casters(scene, capsules, [mesh.hull() for mesh in meshes])
        self._draw_shadows(meshes, casters)
        self._shadow.texture.use(TEXTURE_UNITS["shadow_map"])
        self._contact.texture.use(TEXTURE_UNITS["contact_map"])
        self._ground.draw(self.picture.ground, stage, self._find_shadow_patch(casters))
        drawn_points = np.concatenate([casters, find_mark_points(scene)])
        self.picture.begin(find_visible_region(drawn_points, view.clip_from_world, self.size))
        self._draw_props()
        self._draw_bodies()
        self._mesh_pass.draw(self.picture, meshes, scene, view.eye)
        self._draw_hidden_bodies(scene)
        self._marks.draw(scene)
        self.picture.resolve()
        self._draw_matches(scene)

    def _draw_matches(self, scene: Scene) -> None:
        """Draws the matched or driven chains on top of everything."""
        rows, deepest = make_match_rows(scene.boards if scene.style.cues > 0 else {})
        if len(rows):
            self._tubes = self._tubes or Tubes(self.ctx)
            self._tubes.draw(self.picture, rows, deepest)

    def pixels(self) -> UInt8:
        """Returns (H, W, 3) sRGB of the image, top row first."""
        return self.picture.pixels()

    def present(self, screen: moderngl.Framebuffer, corner: tuple[int, int] = (0, 0)) -> None:
        """Copies the image to a window's framebuffer.

        Its lower left is at ``corner``, in pixels from the bottom left.
        """
        screen.viewport = (*corner, *self.size)
        screen.use()
        self._present["corner"] = corner
        self.ctx.enable_only(moderngl.NOTHING)
        self.picture.texture.use(TEXTURE_UNITS["picture"])
        self._present_quad.render(moderngl.TRIANGLES, vertices=3)

    def prepare_meshes(self, scene: Scene) -> list[SkinnedMesh]:
        """Returns the meshes of the scene in their poses.

        New characters are uploaded, and removed ones released.
        """
        # Bind a framebuffer, because without one OpenGL refuses even calls that draw nothing.
        self.picture.drawn.use()
        names = {actor.character.id for actor in scene.actors}
        glow, bodies = self.settings.held_light * scene.style.held, [body.id for body in scene.bodies]
        for removed in set(self._meshes) - names:
            self._meshes.pop(removed).release()
        for actor in scene.actors:
            mesh = self._meshes.get(actor.character.id)
            if mesh is None or mesh.character is not actor.character:
                crease = _CREASE_ANGLE_RAD
                new_mesh = SkinnedMesh(self.ctx, actor.character, crease, self._skin, self.textures)
                if mesh is not None:
                    # Release the old mesh only after the new mesh has acquired the textures that both share.
                    mesh.release()
                mesh = new_mesh
                self._meshes[actor.character.id] = new_mesh
            mesh.set_glow(compute_node_glow(actor, glow, bodies))
            if actor.vertices is None:
                mesh.skin(actor.pose)
            else:
                mesh.place(actor.vertices)
        return [self._meshes[actor.character.id] for actor in scene.actors]

    def _write_frame(self, box: Box, view: CameraView) -> Float:
        """Fills the uniform block shared by all shaders. Returns the centre (3,) of the pool of light.

        The centre of the pool of light follows the scene slowly.
        """
        centre = (box[0] + box[1]) / 2
        centre[1] = 0.0
        if self._stage is None or float(np.linalg.norm(centre - self._stage)) > 4.0:
            self._stage = centre
        self._stage = self._stage + 0.03 * (centre - self._stage)
        self._light, self._below = light_from_world(box, self._to_key), contact_from_world(box)
        matrices = [view.clip_from_world, np.linalg.inv(view.clip_from_world), self._light, self._below]
        positions = [
            [*view.eye, 1.0],
            [*self._to_key, 0.0],
            [*self._stage, STAGE_RADIUS],
            [*self.size, 0.0, 0.0],
        ]
        look = make_look_rows(LOOKS[self.look], self.settings)
        values = np.concatenate([*(m.T.ravel() for m in matrices), np.ravel(positions), look.ravel()])
        self._frame.write(values.astype("f4").tobytes())
        self._frame.bind_to_uniform_block(BLOCK_BINDINGS["Frame"])
        return self._stage

    def _draw_shadows(self, meshes: list[SkinnedMesh], casters: Float) -> None:
        """Draws and blurs the key light's shadow map and the floor's contact map."""
        passes = (
            (self._shadow, self._light, _SHADOW_BLUR, 1.0),
            (self._contact, self._below, _CONTACT_BLUR, 0.0),
        )
        for target, clip, blur, empty in passes:
            contact = target is self._contact
            target.begin(empty)
            for program in (self._caster, self._body_caster, self._prop_caster):
                set_uniform(program, "clip_from_caster", tuple(clip.T.astype("f4").ravel()))
                set_uniform(program, "contact", contact)
                set_uniform(program, "casting", True)
            for mesh in meshes:
                mesh.render_all(self._caster, coarse=contact)
            if not contact:
                self._mesh_pass.cast(meshes, clip)
            self._shadow_capsules.render()
            self._shadow_props.render()
            target.blur(
                blur,
                find_visible_region(casters, clip, (target.size, target.size), count_spread_texels(blur)),
            )

    def _find_shadow_patch(self, casters: Float) -> Patch:
        """Returns the part of the floor that the casters' blurred shadows may reach."""
        texels = (
            (self._light, self.settings.shadow_size, _SHADOW_BLUR),
            (self._below, self.settings.contact_size, _CONTACT_BLUR),
        )
        margin = max(
            2 / float(np.linalg.norm(clip[0])) / size * count_spread_texels(blur)
            for clip, size, blur in texels
        )
        return find_shadow_bounds(casters, self._to_key, margin / float(self._to_key[1]))

    def _draw_props(self) -> None:
        """Draws the props. The depth test handles occlusion."""
        self.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        set_uniform(self._prop, "casting", False)
        self._props.render()

    def _draw_bodies(self) -> None:
        """Draws the bodies.

        A translucent body covers a fraction of each pixel's samples (alpha to coverage), so that bodies need
        no sorting.
        """
        self.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        set_uniform(self._body, "casting", False)
        set_uniform(self._body, "hidden", False)
        self.ctx.enable_direct(ALPHA_TO_COVERAGE)
        self._capsules.render()
        self.ctx.disable_direct(ALPHA_TO_COVERAGE)

    def _draw_hidden_bodies(self, scene: Scene) -> None:
        """Draws occluded bodies faintly. Overlapping bodies do not add up, because the brighter value is
        used.
        """
        if scene.style.body <= 0:
            return
        self.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
        self.ctx.blend_equation = moderngl.MAX  # type: ignore[assignment]
        self.ctx.depth_func = ">"
        self.picture.write_depth(False)
        set_uniform(self._body, "hidden", True)
        self._capsules.render()
        self.picture.write_depth(True)
        self.ctx.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
