"""Converts a GLB or BVH file of enliven to FBX, with Blender and without its window:

blender -b --factory-startup -P to_fbx.py -- TAKE.glb TAKE.fbx
"""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import bpy
from enliven_live.file_import import import_motion


def convert(source, target):
    """Writes an FBX file: rigs with their meshes, and one animation with a key on each frame."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armatures = import_motion(source)
    if not armatures:
        raise ValueError(f"{source} has no rig")
    temporary = target + ".part"
    try:
        bpy.ops.export_scene.fbx(
            filepath=temporary,
            object_types={"ARMATURE", "MESH"},
            add_leaf_bones=False,
            bake_anim_use_all_actions=False,
            bake_anim_use_nla_strips=False,
            bake_anim_simplify_factor=0.0,
            path_mode="COPY",
            embed_textures=True,
        )
        os.replace(temporary, target)
    finally:
        if os.path.exists(temporary):
            os.remove(temporary)


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    if len(words) != 2:
        sys.exit("usage: blender -b --factory-startup -P to_fbx.py -- TAKE.glb TAKE.fbx")
    try:
        convert(*words)
    except (ValueError, OSError, RuntimeError) as error:
        print(f"to_fbx: {error}", file=sys.stderr)
        sys.exit(1)
