"""Runs inside Blender, and writes what the add-on of integrations/blender did as JSON.

blender -b --factory-startup -P blender_script.py -- FOLDER_OF_THE_ADD_ON TASK ARGUMENTS
"""

import json
import sys
import time

import bpy

FOLDER, TASK, *WORDS = sys.argv[sys.argv.index("--") + 1 :]
sys.path.insert(0, FOLDER)


def armature():
    (rig,) = [each for each in bpy.data.objects if each.type == "ARMATURE"]
    return rig


def heads(rig):
    """Returns the world position of the head of each bone."""
    return {bone.name: list(rig.matrix_world @ bone.head) for bone in rig.pose.bones}


def tails(rig):
    return {bone.name: list(rig.matrix_world @ bone.tail) for bone in rig.pose.bones}


def describe(rig):
    """Returns the rest pose, the scene's frame rate and frame range, and the positions of the bones in each
    frame.
    """
    scene, place = bpy.context.scene, rig.matrix_world
    rest = {
        bone.name: [list(place @ bone.head_local), list(place @ bone.tail_local)] for bone in rig.data.bones
    }
    frames = []
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        frames.append(heads(rig))
    rate = scene.render.fps / scene.render.fps_base
    keys = [point.co[0] for action in bpy.data.actions for point in curves(action)[0].keyframe_points]
    return {"rest": rest, "rate": rate, "start": scene.frame_start, "frames": frames, "keys": keys}


def curves(action):
    """Returns the curves of an action, also of the layered ones of Blender 4.4 and newer."""
    if getattr(action, "fcurves", None):
        return action.fcurves
    return action.layers[0].strips[0].channelbags[0].fcurves


def import_file(path):
    import enliven_live

    enliven_live.register()
    assert bpy.ops.enliven.import_motion(filepath=path) == {"FINISHED"}
    enliven_live.unregister()
    assert not hasattr(bpy.types.Scene, "enliven")
    return describe(armature())


def import_fbx(path):
    bpy.ops.import_scene.fbx(filepath=path)
    scene = bpy.context.scene
    first, last = bpy.data.actions[0].frame_range
    scene.frame_start, scene.frame_end = round(first), round(last)
    return describe(armature())


def receive(path, port_file):
    """Follows a sender until the pose is stable, and returns the pose."""
    from enliven_live.file_import import import_motion
    from enliven_live.live import LiveRig

    import_motion(path)
    rig = armature()
    rig.animation_data_clear()
    live = LiveRig(rig, "127.0.0.1", 0)
    with open(port_file + ".part", "w") as file:
        file.write(str(live.receiver.port))
    import os

    os.replace(port_file + ".part", port_file)
    end, updates = time.monotonic() + 60.0, 0
    while updates < 20 and time.monotonic() < end:
        updates += live.update()
        time.sleep(0.01)
    bpy.context.view_layer.update()
    live.close()
    return {"updates": updates, "heads": heads(rig), "tails": tails(rig), "matched": live.rig.matched}


bpy.ops.wm.read_factory_settings(use_empty=True)
*arguments, target = WORDS
result = {"import": import_file, "fbx": import_fbx, "receive": receive}[TASK](*arguments)
with open(target, "w") as output:
    json.dump(result, output)
