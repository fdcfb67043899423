"""The acts of the example films. Each is defined by at most four key poses."""

from __future__ import annotations

from dataclasses import replace

from example_cast import Act, Key, Point, Shown
from example_posing import Limb, bend, curl, lengthen, put, reach, shift, squash, turn, twist

from enliven.document.example_settings import ExampleSettings
from enliven.document.locomotion import LocomotionSettings

CACTUS = Act(
    title="A cactus directs traffic",
    mesh="meshes/cinolib/cactus.off",
    take="cmu_expmap/train_directing_traffic_4.txt",
    height=1.7,
    up="z",
    turned=90,
    shown=(Shown(0.2, 30.8),),
    locomotion=LocomotionSettings(plant=0.0),  # it rotates on its round base
    colour=(92, 150, 84),
    points=(
        Point("left base", (0.06, 0.02, 0.0), "LeftFoot", foot=True),
        Point("right base", (-0.11, 0.02, 0.0), "RightFoot", foot=True),
        Point("front base", (-0.03, 0.02, 0.1), "LeftFoot", foot=True),
        Point("back base", (-0.03, 0.02, -0.1), "RightFoot", foot=True),
        Point("belly", (-0.03, 0.8, 0.12), "Spine1"),
        Point("head", (-0.05, 1.7, 0.0), "Head"),
        Point("left elbow", (0.40, 1.0, 0.0), "LeftForeArm"),
        Point("left hand", (0.465, 1.63, 0.0), "LeftHand"),
        Point("right elbow", (-0.42, 1.2, 0.0), "RightForeArm"),
        Point("right hand", (-0.476, 1.62, 0.0), "RightHand"),
    ),
    limbs={
        "left arm": Limb(("left elbow", "left hand"), (0.06, 0.9, 0.0)),
        "right arm": Limb(("right elbow", "right hand"), (-0.12, 1.1, 0.0)),
        "left forearm": Limb(("left hand",), (0.40, 1.0, 0.0)),
        "right forearm": Limb(("right hand",), (-0.42, 1.2, 0.0)),
    },
    keys=(
        Key(
            17.33,
            "at ease",
            (
                turn("left forearm", 105, "out"),
                turn("right forearm", 105, "out"),
                squash(0.92),
            ),
        ),
        Key(
            12.02,
            "come on!",
            (
                turn("left forearm", 105, "out"),
                lengthen("right arm", 1.12),
                turn("right forearm", 25, "in"),
                squash(1.06),
                bend(16, "left"),
            ),
        ),
        Key(
            13.62,
            "stop!",
            (
                lengthen("left arm", 1.12),
                lengthen("right arm", 1.12),
                turn("left arm", 10, "up"),
                turn("right arm", 10, "up"),
                squash(1.14),
            ),
        ),
        Key(
            2.93,
            "that way!",
            (
                lengthen("left forearm", 1.1),
                turn("left forearm", 75, "out"),
                turn("left arm", 40, "front"),
                turn("right forearm", 50, "out"),
                turn("right arm", 70, "front"),
                bend(9, "left"),
                twist(20),
            ),
        ),
    ),
)
TREX = Act(
    title="A T-Rex walks",
    mesh="meshes/trex/trex_yana.obj",
    take="cmu_expmap/test_walking_1.txt",
    height=1.8,
    mirrored=True,
    shown=(Shown(0.15, 2.95, 62), Shown(0.15, 2.95, 24, speed=0.5)),
    examples=ExampleSettings(acceleration=0.1),
    colour=(140, 126, 84),
    points=(
        Point("left toes", (0.43, 0.01, 0.29), "LeftToeBase", foot=True),
        Point("right toes", (-0.43, 0.01, 0.29), "RightToeBase", foot=True),
        Point("left ankle", (0.42, 0.40, -0.10), "LeftFoot"),
        Point("right ankle", (-0.42, 0.40, -0.10), "RightFoot"),
        Point("left knee", (0.48, 0.78, 0.28), "LeftLeg"),
        Point("right knee", (-0.48, 0.78, 0.28), "RightLeg"),
        Point("back", (0.0, 1.46, -0.3), "Hips"),
        Point("chest", (0.0, 0.9, 0.75), "Hips"),
        Point("nose", (0.0, 1.66, 1.86), "Hips"),
        Point("tail", (0.0, 1.10, -1.1), "Hips"),
        Point("tip of the tail", (0.0, 1.14, -1.93), "Hips"),
    ),
    limbs={
        "left leg": Limb(("left knee", "left ankle", "left toes"), (0.3, 1.1, 0.0)),
        "right leg": Limb(("right knee", "right ankle", "right toes"), (-0.3, 1.1, 0.0)),
        "head": Limb(("nose",), (0.0, 1.2, 0.6)),
        "long tail": Limb(("tail", "tip of the tail"), (0.0, 1.2, -0.4)),
    },
    keys=(
        Key(
            2.37,
            "the left foot lands",
            (
                reach("left leg", front=0.18),
                reach("right leg", front=-0.24),
                reach("right ankle", up=0.05),
                curl("long tail", 30, "left"),
                turn("head", 10, "left"),
                turn("head", 6, "down"),
                shift(up=-0.05),
            ),
        ),
        Key(
            1.53,
            "the right foot passes",
            (
                reach("right leg", up=0.16, front=-0.02),
                reach("right ankle", up=0.06, front=-0.06),
                turn("head", 6, "up"),
                curl("long tail", 12, "up"),
                shift(up=0.03, left=0.05),
            ),
        ),
    ),
)
ARMADILLO = Act(
    title="The Armadillo boxes",
    mesh="meshes/libigl/armadillo.obj",
    take="bvh/cmu_mirrors/Boxing_Toes.bvh",
    height=1.7,
    shown=(Shown(2.6, 22.0, 20),),
    examples=ExampleSettings(acceleration=0.1, margin=0.6),
    colour=(176, 126, 92),
    points=(
        Point("left toes", (0.50, 0.01, 0.10), "LeftToes", foot=True),
        Point("right toes", (-0.41, 0.01, 0.04), "RightToes", foot=True),
        Point("left heel", (0.37, 0.02, -0.25), "LeftAnkle", foot=True),
        Point("right heel", (-0.29, 0.02, -0.29), "RightAnkle", foot=True),
        Point("hips", (-0.05, 0.73, -0.31), "Hips"),
        Point("shell", (0.0, 1.54, -0.33), "Neck"),
        Point("nose", (-0.03, 1.25, 0.50), "Head"),
        Point("left elbow", (0.51, 1.20, 0.0), "LeftElbow"),
        Point("right elbow", (-0.49, 1.14, -0.02), "RightElbow"),
        Point("left hand", (0.60, 1.36, 0.48), "LeftWrist"),
        Point("right hand", (-0.56, 1.38, 0.44), "RightWrist"),
        Point("tail", (0.07, 0.48, -0.64), "Hips"),
    ),
    limbs={
        "left arm": Limb(("left elbow", "left hand"), (0.30, 1.25, 0.0)),
        "right arm": Limb(("right elbow", "right hand"), (-0.30, 1.25, 0.0)),
        "left forearm": Limb(("left hand",), "left elbow"),
        "right forearm": Limb(("right hand",), "right elbow"),
        "left foot": Limb(("left toes", "left heel"), (0.2, 0.7, 0.0)),
        "right foot": Limb(("right toes", "right heel"), (-0.2, 0.7, 0.0)),
        "trunk": Limb(("shell", "nose"), "hips"),
    },
    keys=(
        Key(
            4.88,
            "on guard",
            (
                put("left heel", left=0.25, front=-0.11),
                put("left toes", left=0.27, front=0.07),
                put("right heel", left=-0.20, front=-0.04),
                put("right toes", left=-0.23, front=0.13),
                turn("left arm", 45, "front"),
                turn("right arm", 40, "front"),
                put("left hand", left=0.12, up=0.78, front=0.42),
                put("right hand", left=-0.22, up=0.72, front=0.40),
                shift(up=-0.03),
            ),
        ),
        Key(
            9.29,
            "cross!",
            (
                put("left heel", left=0.01, front=-0.33, up=0.07),
                put("left toes", left=0.02, front=-0.23, up=0.03),
                put("right heel", left=-0.12, front=0.12),
                put("right toes", left=-0.09, front=0.30),
                put("left elbow", left=0.06, up=0.74, front=0.42),
                put("left hand", left=-0.08, up=0.76, front=0.78),
                turn("right arm", 40, "front"),
                put("right hand", left=-0.22, up=0.66, front=0.36),
                reach("shell", front=0.12),
                shift(front=0.08, up=-0.07),
            ),
        ),
        Key(
            12.52,
            "jab!",
            (
                put("left heel", left=0.22, front=-0.16, up=0.08),
                put("left toes", left=0.24, front=-0.04, up=0.045),
                put("right heel", left=-0.23, front=-0.03),
                put("right toes", left=-0.27, front=0.14),
                put("right elbow", left=-0.42, up=0.72, front=0.16),
                put("right hand", left=-0.74, up=0.86, front=0.24),
                turn("left arm", 45, "front"),
                put("left hand", left=0.06, up=0.86, front=0.42),
                shift(left=-0.05, up=0.03),
            ),
        ),
        Key(
            20.10,
            "ducks",
            (
                put("left heel", left=0.23, front=0.08),
                put("left toes", left=0.24, front=0.25),
                put("right heel", left=-0.10, front=-0.04),
                put("right toes", left=-0.15, front=0.13),
                turn("left arm", 45, "front"),
                turn("right arm", 50, "front"),
                put("left hand", left=0.14, up=0.60, front=0.46),
                put("right hand", left=0.0, up=0.54, front=0.46),
                turn("trunk", 25, "front"),
                shift(up=-0.14, left=0.05),
            ),
        ),
    ),
)
ALLIGATOR = Act(
    title="A paper alligator hops",
    mesh="meshes/common3d/alligator.obj",
    take="bvh/cmu_mirrors/01_01.bvh",
    height=0.5,
    turned=90,
    shown=(Shown(0.5, 14.9, 68),),
    examples=ExampleSettings(acceleration=0.1),
    colour=(190, 214, 132),
    points=(
        Point("front foot", (0.0, 0.045, 0.52), "LeftToeBase", foot=True),
        Point("hind foot", (0.0, 0.048, -0.23), "RightToeBase", foot=True),
        Point("nape", (0.0, 0.49, 0.45), "Hips"),
        Point("back", (0.0, 0.45, -0.21), "Hips"),
        Point("snout", (0.0, 0.37, 1.42), "Head"),
        Point("jaw", (0.0, 0.22, 1.38), "Head"),
        Point("tail", (0.0, 0.30, -1.02), "Hips"),
        Point("tip of the tail", (0.0, 0.27, -1.42), "Hips"),
    ),
    limbs={
        "head": Limb(("jaw", "snout"), "nape"),
        "upper jaw": Limb(("snout",), (0.0, 0.30, 0.85)),
        "long tail": Limb(("tail", "tip of the tail"), "back"),
        "body": Limb(("back", "nape", "tail", "tip of the tail", "jaw", "snout"), (0.0, 0.2, -0.2)),
    },
    keys=(
        Key(12.19, "waits", (curl("long tail", 12, "up"),)),
        Key(
            12.65,
            "crouches",
            (
                curl("long tail", 80, "up"),
                curl("long tail", 30, "left"),
                turn("head", 14, "down"),
                reach("head", front=-0.25),
                shift(up=-0.22, front=-0.1),
                turn("upper jaw", 8, "up"),
            ),
        ),
        Key(
            20.35,
            "leaps",
            (
                turn("body", 38, "up"),
                curl("long tail", 25, "up"),
                put("front foot", up=0.75, front=1.25),
                put("hind foot", up=-0.1, front=-0.8),
                shift(up=0.25, front=0.2),
            ),
        ),
        Key(
            6.88,
            "lands",
            (
                turn("upper jaw", 25, "up"),
                turn("body", 8, "down"),
                curl("long tail", 55, "up"),
                put("front foot", front=1.5),
                put("hind foot", front=0.2),
                shift(up=0.25),
            ),
        ),
    ),
)
MILLION = replace(
    ARMADILLO,
    title="The Armadillo boxes with a million vertices",
    shown=(Shown(8.4, 12.9, 20),),
    of="armadillo",
    finer=0.0035,
)
ACTS = {
    "cactus": CACTUS,
    "trex": TREX,
    "armadillo": ARMADILLO,
    "alligator": ALLIGATOR,
    "million": MILLION,
}
