"""Moves the active armature live, by the bones that `enliven edge --out vmc:HOST` sends."""

import bpy
from bpy.props import BoolProperty, IntProperty, PointerProperty
from mathutils import Quaternion

from .humanoid import Rig
from .vmc import VmcReceiver

INTERVAL_S = 1.0 / 60.0
"""Seconds between two looks at the port."""


class LiveRig:
    """An armature that follows the bones of a receiver.

    Raises:
        ValueError: if the armature has no humanoid bones.
        OSError: for a port in use.
    """

    def __init__(self, armature, host, port):
        self.rig = Rig(rest_of(armature))
        self.armature = armature
        self.receiver = VmcReceiver(host, port)

    def update(self):
        """Applies the newest bones. Returns True if some came."""
        if not self.receiver.poll() or not self.receiver.is_loaded:
            return False
        basis, place = self.rig.pose(self.receiver.bones)
        for name, turn in basis.items():
            bone = self.armature.pose.bones[name]
            bone.rotation_mode = "QUATERNION"
            bone.rotation_quaternion = Quaternion(turn)
        if place is not None:
            self.armature.pose.bones[self.rig.matched["Hips"]].location = place
        return True

    def close(self):
        """Frees the port."""
        self.receiver.close()


def rest_of(armature):
    """Returns the rest pose of an armature, as :class:`.humanoid.Rig` takes it."""
    rows = []
    for bone in armature.data.bones:  # Parents come first.
        turn = bone.matrix_local.to_quaternion()
        parent = bone.parent.name if bone.parent else None
        rows.append((bone.name, parent, tuple(bone.head_local), tuple(turn)))
    return rows


_live = None
"""The rig that follows a receiver, or None."""


def _tick():
    """Updates the rig. Blender calls it until it returns None."""
    if _live is None:
        return None
    try:
        _live.update()
    except ReferenceError:  # The armature was deleted.
        stop()
        return None
    return INTERVAL_S


def start(armature, host, port):
    """Starts to move an armature. One that moves already stops."""
    global _live
    stop()
    _live = LiveRig(armature, host, port)
    bpy.app.timers.register(_tick)


def stop():
    """Stops. The rig keeps its last pose."""
    global _live
    if _live is not None:
        _live.close()
        _live = None


class EnlivenSettings(bpy.types.PropertyGroup):
    port: IntProperty(
        name="Port", default=39539, min=1, max=65535, description="UDP port on which the add-on receives VMC"
    )
    from_network: BoolProperty(
        name="Other computers",
        description="Also receive motion from other computers. "
        "Everyone who can reach this computer can then send motion",
    )


class ENLIVEN_OT_receive(bpy.types.Operator):
    """Move the active armature by the motion that enliven sends (enliven edge --out vmc:127.0.0.1)"""

    bl_idname = "enliven.receive"
    bl_label = "Receive"

    @classmethod
    def poll(cls, context):
        return _live is not None or (context.object is not None and context.object.type == "ARMATURE")

    def execute(self, context):
        if _live is not None:
            stop()
            return {"FINISHED"}
        settings = context.scene.enliven
        host = "0.0.0.0" if settings.from_network else "127.0.0.1"
        try:
            start(context.object, host, settings.port)
        except ValueError as error:
            self.report({"ERROR"}, f"{error}. Use the bone names of Mixamo, VRM or Rigify")
            return {"CANCELLED"}
        except OSError as error:
            text = f"port {settings.port} cannot be opened ({error.strerror}). Choose another one"
            self.report({"ERROR"}, text)
            return {"CANCELLED"}
        return {"FINISHED"}


class ENLIVEN_PT_panel(bpy.types.Panel):
    bl_label = "enliven"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "enliven"

    def draw(self, context):
        layout, settings = self.layout, context.scene.enliven
        column = layout.column()
        column.enabled = _live is None
        column.prop(settings, "port")
        column.prop(settings, "from_network")
        layout.operator(ENLIVEN_OT_receive.bl_idname, text="Receive" if _live is None else "Stop")
        if _live is not None:
            layout.label(text=f"{_live.receiver.packets} packets, {len(_live.rig.matched)} bones")


_CLASSES = (EnlivenSettings, ENLIVEN_OT_receive, ENLIVEN_PT_panel)


def register():
    for each in _CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.enliven = PointerProperty(type=EnlivenSettings)


def unregister():
    stop()
    del bpy.types.Scene.enliven
    for each in reversed(_CLASSES):
        bpy.utils.unregister_class(each)
