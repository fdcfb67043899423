"""Moves the bones of a rig as those of Unity's humanoid, whatever its rest pose is. It needs no Blender.

Quaternions are tuples (w, x, y, z). The axes are Blender's: a figure in the T-pose faces -Y, its left is at
+X and +Z is up.
"""

import math
import re

IDENTITY = (1.0, 0.0, 0.0, 0.0)
PARENTS = {
    "Hips": "",
    "Spine": "Hips",
    "Chest": "Spine",
    "UpperChest": "Chest",
    "Neck": "UpperChest",
    "Head": "Neck",
}
"""The parent of each bone of Unity's humanoid, parents first."""
_LIMBS = {
    "Shoulder": "UpperChest",
    "UpperArm": "Shoulder",
    "LowerArm": "UpperArm",
    "Hand": "LowerArm",
    "UpperLeg": "Hips",
    "LowerLeg": "UpperLeg",
    "Foot": "LowerLeg",
    "Toes": "Foot",
}
for _side in ("Left", "Right"):
    for _bone, _parent in _LIMBS.items():
        PARENTS[_side + _bone] = _parent if _parent in PARENTS else _side + _parent

_TRUNK_NAMES = {
    "Hips": "hips pelvis hip",
    "Spine": "spine spine01 abdomen",
    "Chest": "chest spine1 spine02 torso",
    "UpperChest": "upperchest spine2 spine03",
    "Neck": "neck neck01",
    "Head": "head",
}
_RIGIFY_NAMES = {
    "Hips": "spine",
    "Spine": "spine001",
    "Chest": "spine002",
    "UpperChest": "spine003",
    "Neck": "spine004",
    "Head": "spine006 head",
}
"""Rigify numbers the bones of the trunk from the hips to the head."""
_LIMB_NAMES = {
    "Shoulder": "shoulder clavicle collar",
    "UpperArm": "upperarm arm",
    "LowerArm": "lowerarm forearm",
    "Hand": "hand fist",
    "UpperLeg": "upperleg upleg thigh",
    "LowerLeg": "lowerleg leg shin calf",
    "Foot": "foot",
    "Toes": "toes toebase toe ball",
}
_SIDES = {"Left": ("left{0}", "{0}left", "{0}l", "l{0}"), "Right": ("right{0}", "{0}right", "{0}r", "r{0}")}
_PREFIXES = re.compile(r"^(?:.*:|def[-_ ]|bip01[ _]?|j_bip_[clr]_|cc_base_)", re.IGNORECASE)


def _word(name):
    return re.sub(r"[^a-z0-9]", "", _PREFIXES.sub("", name).lower())


def match_bones(names):
    """Returns the name of the rig's bone for each bone of the humanoid that it has.

    It knows the names of Mixamo, VRM, Unreal, Rigify, Quaternius and Biped.
    """
    words = {}
    for name in names:
        words.setdefault(_word(name), name)
    found = {}
    trunk = _RIGIFY_NAMES if "spine001" in words else _TRUNK_NAMES
    for bone, aliases in trunk.items():
        for alias in aliases.split():
            if alias in words and words[alias] not in found.values():
                found[bone] = words[alias]
                break
    for side, forms in _SIDES.items():
        for bone, aliases in _LIMB_NAMES.items():
            candidates = [form.format(alias) for alias in aliases.split() for form in forms]
            match = next((each for each in candidates if each in words), None)
            if match is not None:
                found[side + bone] = words[match]
    return found


class Rig:
    """The rest pose of a rig.

    Args:
        bones: (name, name of the parent or None, (3,) head in metres, rest rotation), parents first, all in
            the axes of the armature.
        matched: see :func:`match_bones`. None finds them.

    Raises:
        ValueError: if the rig has no hips, or no legs to tell its front by.
    """

    def __init__(self, bones, matched=None):
        self.bones = list(bones)
        self._heads = {name: head for name, _, head, _ in self.bones}
        self.matched = match_bones(self._heads) if matched is None else matched
        missing = [bone for bone in ("Hips", "LeftUpperLeg", "RightUpperLeg") if bone not in self.matched]
        if missing:
            raise ValueError("the rig has no bone for " + ", ".join(missing))
        self._hips = self._head("Hips")
        self.matched["Hips"] = self._carrier()
        self._humanoid = {name: bone for bone, name in self.matched.items()}
        left, right = self._head("LeftUpperLeg"), self._head("RightUpperLeg")
        self._to_front = _about_z(-math.atan2(left[1] - right[1], left[0] - right[0]))
        self._t_pose = self._find_t_pose()

    def pose(self, bones):
        """Returns the pose for bones of the humanoid.

        Args:
            bones: by name, position and rotation relative to the parent, as ``VmcReceiver.bones``.

        Returns:
            The rotation of each bone of the rig from its rest pose, in its own axes, and the place of the
            bone ``matched["Hips"]`` in the same way, or None without hips.
        """
        world = {}
        for bone in PARENTS:
            if bone in bones:
                parent = PARENTS[bone]
                while parent and parent not in bones:
                    parent = PARENTS[parent]
                world[bone] = multiply(world.get(parent, IDENTITY), bones[bone][1])
        turns, rests, basis, place = {}, {}, {}, None
        for name, parent, head, rest in self.bones:
            above = multiply(turns[parent], multiply(inverse(rests[parent]), rest)) if parent else rest
            bone = self._humanoid.get(name)
            turn = above
            if bone in world:
                turn = multiply(world[bone], multiply(self._to_front, multiply(self._t_pose[bone], rest)))
            turns[name], rests[name] = turn, rest
            basis[name] = multiply(inverse(above), turn)
            if bone == "Hips" and bone in bones:
                scale, lever = self._scale(bones), [x - at for x, at in zip(self._hips, head)]  # noqa: B905
                lever = rotate(multiply(turn, inverse(rest)), lever)
                target = [scale * x for x in bones[bone][0]]
                offset = [x - y - at for x, y, at in zip(target, lever, head)]  # noqa: B905
                place = rotate(inverse(rest), offset)
        return basis, place

    def _carrier(self):
        """Returns the bone that moves both legs and the hips, because legs may hang on another bone."""
        parents = {name: parent for name, parent, _, _ in self.bones}

        def above(name):
            while name is not None:
                yield name
                name = parents[name]

        legs = [set(above(self.matched[side + "UpperLeg"])) for side in ("Left", "Right")]
        common = (name for name in above(self.matched["Hips"]) if all(name in leg for leg in legs))
        return next(common, self.matched["Hips"])

    def _scale(self, bones):
        """Returns the length of the rig's legs, as a multiple of the figure's."""
        needed = ("LeftLowerLeg", "LeftFoot")
        if not all(bone in bones and bone in self.matched for bone in needed):
            return 1.0
        figure = sum(math.dist((0.0, 0.0, 0.0), bones[bone][0]) for bone in needed)
        heads = [self._head(bone) for bone in ("LeftUpperLeg", *needed)]
        own = math.dist(heads[0], heads[1]) + math.dist(heads[1], heads[2])
        return own / figure if figure > 0.01 else 1.0

    def _find_t_pose(self):
        """Returns the rotation of each bone from the rest pose to the T-pose."""
        turns = {bone: IDENTITY for bone in PARENTS}
        back = inverse(self._to_front)
        for side, sign in (("Left", 1.0), ("Right", -1.0)):
            for bones, direction in (
                (("UpperArm", "LowerArm", "Hand"), rotate(back, (sign, 0.0, 0.0))),
                (("UpperLeg", "LowerLeg", "Foot"), (0.0, 0.0, -1.0)),
            ):
                for bone, end in zip(bones, bones[1:]):  # noqa: B905, RUF007
                    if side + bone in self.matched and side + end in self.matched:
                        begin = self._head(side + bone)
                        along = [b - a for a, b in zip(begin, self._head(side + end))]  # noqa: B905
                        turns[side + bone] = swing(along, direction)
            turns[side + "Hand"] = turns[side + "LowerArm"]
        return turns

    def _head(self, bone):
        return self._heads[self.matched[bone]]


def multiply(a, b):
    """Returns the rotation b followed by a."""
    w, x, y, z = a
    p, q, r, s = b
    return (
        w * p - x * q - y * r - z * s,
        w * q + x * p + y * s - z * r,
        w * r - x * s + y * p + z * q,
        w * s + x * r - y * q + z * p,
    )


def inverse(a):
    """Returns the opposite rotation."""
    return a[0], -a[1], -a[2], -a[3]


def rotate(a, v):
    """Returns a rotated vector."""
    return multiply(multiply(a, (0.0, *v)), inverse(a))[1:]


def swing(a, b):
    """Returns the shortest rotation between two directions. The identity for vectors without length."""
    first, second = math.sqrt(sum(x * x for x in a)), math.sqrt(sum(x * x for x in b))
    if first < 1e-9 or second < 1e-9:
        return IDENTITY
    a, b = [x / first for x in a], [x / second for x in b]
    w = 1.0 + sum(x * y for x, y in zip(a, b))  # noqa: B905
    if w < 1e-6:  # Opposite directions: half a turn about any perpendicular axis.
        axis = (0.0, -a[2], a[1]) if abs(a[0]) < 0.9 else (-a[2], 0.0, a[0])
        length = math.sqrt(sum(x * x for x in axis))
        return (0.0, *(x / length for x in axis))
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    length = math.sqrt(w * w + sum(x * x for x in cross))
    return (w / length, *(x / length for x in cross))


def _about_z(angle):
    return math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)
