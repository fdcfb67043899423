"""Imports GLB and BVH files that enliven exported, with the right rest pose, frame rate and range."""

import os

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ImportHelper

from .glb import GlbMotion

_LONGEST_BONE_M = 5.0
"""Metres that no bone is long. The unit of a BVH file with larger numbers is the centimetre."""


def import_motion(path):
    """Imports a file, and returns the new armatures.

    Blender's own importers read the file. This adds three things: bones that end where their child begins,
    the frame rate of the motion (Blender would keep that of the scene, and put keys between frames), and the
    frame range.

    Raises:
        ValueError: for another kind of file, or one that is not readable.
    """
    before = set(bpy.data.objects)
    ending = os.path.splitext(path)[1].lower()
    if ending == ".glb":
        _import_glb(path)
    elif ending == ".bvh":
        _import_bvh(path)
    else:
        raise ValueError(f"{ending} cannot be imported by this add-on. Choose a .glb or .bvh file")
    return [each for each in bpy.data.objects if each not in before and each.type == "ARMATURE"]


def _import_glb(path):
    motion = GlbMotion(path)
    scene = bpy.context.scene
    if motion.rate > 0.0:
        _set_rate(scene, motion.rate)
    _repair_gltf_importer()
    # "FORTUNE" puts the end of a bone at its child. It goes wrong if bones are squeezed, as those of a
    # possessed mesh can be. Their ends then stay on the axes of the file.
    heuristic = "TEMPERANCE" if motion.is_squeezed else "FORTUNE"
    bpy.ops.import_scene.gltf(filepath=path, bone_heuristic=heuristic, guess_original_bind_pose=True)
    if motion.seconds > 0.0:
        scene.frame_start = 0
        scene.frame_end = max(1, round(motion.seconds * scene.render.fps / scene.render.fps_base))


def _import_bvh(path):
    _repair_bvh_importer()
    bpy.ops.import_anim.bvh(
        filepath=path,
        global_scale=_metres_of_bvh(path),
        axis_forward="-Z",
        axis_up="Y",
        rotate_mode="QUATERNION",
        update_scene_fps=True,
    )
    scene = bpy.context.scene
    first, last = bpy.context.object.animation_data.action.frame_range
    scene.frame_start, scene.frame_end = round(first), round(last)


def _metres_of_bvh(path):
    """Returns the unit of a BVH file in metres. Bones longer than 5 m mean that it is the centimetre."""
    longest = 0.0
    with open(path, encoding="utf-8", errors="replace") as file:
        for line in file:
            words = line.split()
            if words[:1] == ["MOTION"]:
                break
            if words[:1] == ["OFFSET"]:
                longest = max(longest, *(abs(float(word)) for word in words[1:4]))
    return 0.01 if longest > _LONGEST_BONE_M else 1.0


def _set_rate(scene, rate):
    """Sets the frame rate of a scene, also one that is not a whole number."""
    scene.render.fps = max(1, round(rate))
    scene.render.fps_base = scene.render.fps / rate if abs(rate - round(rate)) > 0.01 else 1.0


def _repair_gltf_importer():
    """Brings back a name that Debian's Blender 3.4 uses, and that NumPy 1.24 has removed."""
    if bpy.app.version < (3, 6, 0):
        try:
            import numpy
        except ModuleNotFoundError:
            message = "Blender's glTF importer needs NumPy. Install it: sudo apt install python3-numpy"
            raise RuntimeError(message) from None

        if "bool" not in vars(numpy):
            numpy.bool = bool


def _repair_bvh_importer():
    """Lets the importer of Debian's Blender 3.4 open files: Python 3.11 has removed its mode "rU"."""
    if bpy.app.version < (3, 6, 0):
        from io_anim_bvh import import_bvh

        def open_text(path, mode="r", **keys):
            return open(path, mode.replace("U", ""), **keys)

        import_bvh.open = open_text


class ENLIVEN_OT_import(bpy.types.Operator, ImportHelper):
    """Import the motion of an enliven export with its rest pose, frame rate and range"""

    bl_idname = "enliven.import_motion"
    bl_label = "Import enliven motion"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012
    filter_glob: StringProperty(default="*.glb;*.bvh", options={"HIDDEN"})

    def execute(self, context):
        try:
            armatures = import_motion(self.filepath)
        except (ValueError, OSError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{len(armatures)} rigs, {context.scene.frame_end} frames")
        return {"FINISHED"}


def _menu(menu, context):
    menu.layout.operator(ENLIVEN_OT_import.bl_idname, text="enliven motion (.glb, .bvh)")


def register():
    bpy.utils.register_class(ENLIVEN_OT_import)
    bpy.types.TOPBAR_MT_file_import.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(_menu)
    bpy.utils.unregister_class(ENLIVEN_OT_import)
