"""Generates people with the joint names of real conventions, random proportions, and additional joints."""

from __future__ import annotations

import numpy as np
from made_bodies import man

from enliven.document.skeleton import Skeleton

CONVENTIONS: dict[str, dict[str, str]] = {
    "mixamo": dict(
        hips="mixamorig:Hips", spine="mixamorig:Spine", chest="mixamorig:Spine2", neck="mixamorig:Neck",
        head="mixamorig:Head", top="mixamorig:HeadTop_End", collar="mixamorig:{Left}Shoulder",
        shoulder="mixamorig:{Left}Arm", elbow="mixamorig:{Left}ForeArm", wrist="mixamorig:{Left}Hand",
        finger="mixamorig:{Left}HandMiddle1", thumb="mixamorig:{Left}HandThumb1", hip="mixamorig:{Left}UpLeg",
        knee="mixamorig:{Left}Leg", ankle="mixamorig:{Left}Foot", toe="mixamorig:{Left}ToeBase",
    ),
    "vrm": dict(
        hips="hips", spine="spine", chest="upperChest", neck="neck", head="head", top="head_end",
        collar="{left}Shoulder", shoulder="{left}UpperArm", elbow="{left}LowerArm", wrist="{left}Hand",
        finger="{left}MiddleProximal", thumb="{left}ThumbProximal", hip="{left}UpperLeg",
        knee="{left}LowerLeg", ankle="{left}Foot", toe="{left}Toes",
    ),
    "vroid": dict(
        hips="J_Bip_C_Hips", spine="J_Bip_C_Spine", chest="J_Bip_C_Chest", neck="J_Bip_C_Neck",
        head="J_Bip_C_Head", top="J_Bip_C_Head_end", collar="J_Bip_{L}_Shoulder",
        shoulder="J_Bip_{L}_UpperArm", elbow="J_Bip_{L}_LowerArm", wrist="J_Bip_{L}_Hand",
        finger="J_Bip_{L}_Middle1", thumb="J_Bip_{L}_Thumb1", hip="J_Bip_{L}_UpperLeg",
        knee="J_Bip_{L}_LowerLeg", ankle="J_Bip_{L}_Foot", toe="J_Bip_{L}_ToeBase",
    ),
    "unreal": dict(
        hips="pelvis", spine="spine_01", chest="spine_03", neck="neck_01", head="head", top="head_end",
        collar="clavicle_{l}", shoulder="upperarm_{l}", elbow="lowerarm_{l}", wrist="hand_{l}",
        finger="middle_01_{l}", thumb="thumb_01_{l}", hip="thigh_{l}", knee="calf_{l}", ankle="foot_{l}",
        toe="ball_{l}",
    ),
    "rigify": dict(
        hips="DEF-spine", spine="DEF-spine.001", chest="DEF-spine.003", neck="DEF-spine.004",
        head="DEF-head", top="DEF-head_end", collar="DEF-shoulder.{L}", shoulder="DEF-upper_arm.{L}",
        elbow="DEF-forearm.{L}", wrist="DEF-hand.{L}", finger="DEF-f_middle.01.{L}", thumb="DEF-thumb.01.{L}",
        hip="DEF-thigh.{L}", knee="DEF-shin.{L}", ankle="DEF-foot.{L}", toe="DEF-toe.{L}",
    ),
    "quaternius": dict(
        hips="Hips", spine="Abdomen", chest="Torso", neck="Neck", head="Head", top="Head_end",
        collar="Shoulder.{L}", shoulder="UpperArm.{L}", elbow="LowerArm.{L}", wrist="Fist.{L}",
        finger="Middle1.{L}", thumb="Thumb1.{L}", hip="UpperLeg.{L}", knee="LowerLeg.{L}", ankle="Foot.{L}",
        toe="Foot.{L}_end",
    ),
    "bandai namco": dict(
        hips="Hips", spine="Spine", chest="Chest", neck="Neck", head="Head", top="Head end",
        collar="Shoulder_{L}", shoulder="UpperArm_{L}", elbow="LowerArm_{L}", wrist="Hand_{L}",
        finger="Hand_{L} end", thumb="Thumb_{L}", hip="UpperLeg_{L}", knee="LowerLeg_{L}", ankle="Foot_{L}",
        toe="Toes_{L}",
    ),
    "biovision": dict(
        hips="Hips", spine="Chest", chest="Chest4", neck="Neck", head="Head", top="Head end",
        collar="{Left}Collar", shoulder="{Left}Shoulder", elbow="{Left}Elbow", wrist="{Left}Wrist",
        finger="{Left}Wrist end", thumb="{Left}Thumb", hip="{Left}Hip", knee="{Left}Knee",
        ankle="{Left}Ankle", toe="{Left}Toe",
    ),
    "biped": dict(
        hips="Bip01 Pelvis", spine="Bip01 Spine", chest="Bip01 Spine2", neck="Bip01 Neck", head="Bip01 Head",
        top="Bip01 HeadNub", collar="Bip01 {L} Clavicle", shoulder="Bip01 {L} UpperArm",
        elbow="Bip01 {L} Forearm", wrist="Bip01 {L} Hand", finger="Bip01 {L} Finger2",
        thumb="Bip01 {L} Finger0", hip="Bip01 {L} Thigh", knee="Bip01 {L} Calf", ankle="Bip01 {L} Foot",
        toe="Bip01 {L} Toe0",
    ),
    "poser": dict(
        hips="hip", spine="abdomen", chest="chest", neck="neck", head="head", top="head_end",
        collar="{l}Collar", shoulder="{l}Shldr", elbow="{l}ForeArm", wrist="{l}Hand", finger="{l}Mid1",
        thumb="{l}Thumb1", hip="{l}Thigh", knee="{l}Shin", ankle="{l}Foot", toe="{l}Toe",
    ),
}  # fmt: skip
"""Joint names of each convention, by the joints of :func:`made_bodies.man`."""
_SIDES = {
    "Left": {"Left": "Left", "left": "left", "L": "L", "l": "l"},
    "Right": {"Left": "Right", "left": "right", "L": "R", "l": "r"},
}


def convention_name(convention: str, joint: str) -> str:
    """Returns a convention's name for a joint of :func:`made_bodies.man`, such as "Left elbow"."""
    side, _, plain = joint.rpartition(" ")
    return CONVENTIONS[convention][plain].format(**_SIDES.get(side, _SIDES["Left"]))


def person(convention: str, random: np.random.Generator | None = None, extras: bool = False) -> Skeleton:
    """Returns a person with a convention's names.

    Args:
        random: generator for bone lengths (times 0.7 to 1.4, equal on both sides) and the arms' rest
            pose. None keeps both.
        extras: True to add a weapon in the right hand, hair, twist bones in the forearms and one more
            finger.
    """
    plain = man()
    names = [convention_name(convention, name) for name in plain.names]
    parents, at = plain.parents.tolist(), plain.positions.copy()
    if random is not None:
        down = random.uniform(0.0, 1.2)
        factors = {name.split()[-1]: random.uniform(0.7, 1.4) for name in plain.names}
        for j in range(1, len(plain)):
            way = plain.vectors[j] * factors[plain.names[j].split()[-1]]
            sign = {"Left": -1.0, "Right": 1.0}.get(plain.names[j].split()[0], 0.0)
            if sign and plain.names[j].split()[1] in ("elbow", "wrist", "finger", "thumb"):
                c, s = np.cos(sign * down), np.sin(sign * down)
                way = np.array([c * way[0] - s * way[1], s * way[0] + c * way[1], way[2]])
            at[j] = at[parents[j]] + way
    places = list(at)
    if extras:
        for name, above, place in (
            ("Weapon", "Right wrist", (-0.05, 0.0, 0.05)),
            ("Weapon_end", "Weapon", (-0.05, 0.9, 0.4)),
            ("Hair.001", "head", (0.0, 0.05, -0.12)),
            ("Hair.002", "Hair.001", (0.0, -0.3, -0.1)),
            ("lowerarm_twist_01_l", "Left elbow", (0.1, 0.0, 0.02)),
            ("thigh_twist_01_l", "Left hip", (0.0, -0.15, 0.02)),
            ("ik_hand_l", "Left wrist", (0.02, 0.03, 0.0)),
            ("Pinky1", "Left wrist", (0.05, 0.0, -0.04)),
        ):
            number = (
                names.index(convention_name(convention, above))
                if above in plain.names
                else names.index(above)
            )
            names.append(name)
            parents.append(number)
            places.append(places[number] + np.array(place))
    return Skeleton(tuple(names), np.array(parents), np.array(places))
