"""Finds the limbs of a human skeleton from the names of its joints.

    joints = find_human_joints(skeleton)      # None if the names follow no known convention
    joints.arms[0].knots                 # left shoulder, elbow and wrist

Known conventions: Mixamo, VRM and Unity humanoid, Unreal, Rigify (also its split deform bones), Quaternius,
CMU, Bandai Namco, Biovision, Biped, VRoid, Poser. These conventions use the same words differently. For
example, a "Leg" is the shin in Mixamo and the thigh elsewhere, and a "Shoulder" is a collar bone or an upper
arm. So the search for a limb starts at its middle joint, which has the least ambiguous names. The names of
the other joints are tried from the least to the most ambiguous.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from enliven.document import Skeleton

_ELBOW_NAMES = (("forearm", "lowerarm", "armlower", "loarm"), ("elbow",))
"""Names of the joint in the middle of an arm, the least ambiguous first."""
_SHOULDER_NAMES = (("upperarm", "uparm", "armupper", "humerus"), ("arm",), ("shldr", "shoulder"))
"""Names of the joint at which an upper arm begins."""
_WRIST_NAMES = (("hand", "wrist"), ("palm", "fist"))
"""Names of the joint at which a hand begins."""
_KNEE_NAMES = (("lowerleg", "leglower", "loleg", "lowleg", "shin", "calf"), ("knee",), ("leg",))
"""Names of the joint in the middle of a leg."""
_HIP_NAMES = (("upperleg", "legupper", "upleg", "thigh", "femur"), ("leg",), ("hip",))
"""Names of the joint at which a thigh begins."""
_ANKLE_NAMES = (("foot", "ankle"),)
"""Names of the joint at which a foot begins."""
_HEAD_NAMES = (("head",),)
"""Names of the joint at which a head begins."""
_NECK_NAMES = (("neck",),)
"""Names of the joint at which a neck begins."""
_FINGER_NAMES = ("thumb", "index", "middle", "mid", "ring", "pinky", "little")
"""First words of the names of fingers. The joints of one finger share a word."""
_TOE_NAMES = ("toe", "toes", "toebase", "ball")
"""Names of the joint at which toes begin."""
_TIP_WORDS = ("end", "tip", "nub", "top", "site")
"""Words in the names of joints that only mark the end of a bone."""
_EXPORTER_PREFIXES = (
    "armature",
    "base",
    "bip",
    "bone",
    "cc",
    "character",
    "def",
    "org",
    "rig",
    "root",
    "valvebiped",
)
_RIG_PREFIXES = ("b", "bn", "c", "d", "f", "j", "jnt", "joint", "s", "sk", "skel", "valve")
_FILLER_WORDS = frozenset((*_EXPORTER_PREFIXES, *_RIG_PREFIXES))
"""Words that do not identify a joint: prefixes of exporters and rigs."""
_HELPER_WORDS = re.compile(
    r"(?<![a-z])(twist|roll|ik|fk|pole|target|ctrl|control|helper|tweak|mch|vis|adj|sec|corrective|share|"
    r"weapon|sword|gun|prop|attach|socket|slot)(?![a-z])"
)
"""Words in the names of joints that do not belong to a limb: twist and roll bones, controllers, weapons."""
_OBJECT_WORDS = frozenset(
    (
        *("axe", "blade", "bow", "dagger", "gun", "hammer", "knife", "mace", "pistol", "prop", "rifle"),
        *("shield", "spear", "staff", "sword", "torch", "wand", "weapon"),
    )
)
"""Words in the names of joints that move an object carried by a hand."""
_SIDE_OF_WORD = {"left": 1, "l": 1, "right": -1, "r": -1}
"""The side that a word means: 1 for left, -1 for right."""
_WORD_PATTERN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
"""Pattern of a word in a name. Words are separated by camel case or by any character that is not a letter."""


@dataclass(frozen=True)
class HumanLimb:
    """An arm or a leg of a human skeleton.

    Attributes:
        knots: the joints at which the upper segment, the lower segment and the hand or foot begin. If the
            hand or foot has no joint, the third joint is the end of the lower segment.
        tip: the joint at which the hand or foot ends: the middle finger's knuckle, or the toes. -1 if
            unknown.
    """

    knots: tuple[int, int, int]
    tip: int


@dataclass(frozen=True)
class HumanJoints:
    """The joints of a human skeleton, found by their names.

    Attributes:
        hips: the joint at the fork of the legs.
        chest: the joint at the fork of the arms.
        arms, legs: the limbs as (left, right).
        head: the joints from the chest to the end of the head. Empty if no joint is named head.
        head_knots: joints of ``head`` at which the neck and the head begin.
        tail: the joints of the tail. The first joint is at or above the hips, and the tail is attached to it.
            Empty if no joint is named tail.
    """

    hips: int
    chest: int
    arms: tuple[HumanLimb, HumanLimb]
    legs: tuple[HumanLimb, HumanLimb]
    head: tuple[int, ...]
    head_knots: tuple[int, ...]
    tail: tuple[int, ...] = ()


def find_human_joints(skeleton: Skeleton) -> HumanJoints | None:
    """Returns the joints of a person by name, or None if names do not identify two arms and two legs."""
    words = [_split_name(name) for name in skeleton.names]
    arms = [
        _limb_of_side(skeleton, words, side, _SHOULDER_NAMES, _ELBOW_NAMES, _WRIST_NAMES) for side in (1, -1)
    ]
    legs = [_limb_of_side(skeleton, words, side, _HIP_NAMES, _KNEE_NAMES, _ANKLE_NAMES) for side in (1, -1)]
    if arms[0] is None or arms[1] is None or legs[0] is None or legs[1] is None:
        return None
    chest = _find_common_ancestor(skeleton, arms[0].knots[0], arms[1].knots[0])
    hips = _find_common_ancestor(skeleton, legs[0].knots[0], legs[1].knots[0])
    head, head_knots = _head_chain(skeleton, words, chest)
    tail = _tail_chain(skeleton, words, hips)
    return HumanJoints(hips, chest, (arms[0], arms[1]), (legs[0], legs[1]), head, head_knots, tail)


def finger_joints(skeleton: Skeleton, wrist: int) -> dict[str, tuple[int, ...]]:
    """Returns the joints of each named finger of a hand, from the wrist to the end of the finger.

    The finger "little" is returned as "pinky"."""
    fingers = dict[str, tuple[int, ...]]()
    for joint in skeleton.list_subtree(wrist)[1:]:
        finger = _finger_name(_split_name(skeleton.names[joint])[1])
        path = skeleton.path(wrist, joint)
        if finger and len(path) > len(fingers.get(finger, ())):
            fingers[finger] = path
    return fingers


def names_object(name: str) -> bool:
    """Returns True if the name of a joint contains a word for an object that a hand carries."""
    return any(part.lower() in _OBJECT_WORDS for part in _WORD_PATTERN.findall(name))


def _finger_name(word: str) -> str:
    """Returns the standard name of the finger that a word of a joint name means, or an empty string."""
    short_word = word.removeprefix("hand").removesuffix("finger")
    short_word = short_word.removeprefix("finger")
    finger_word = next((finger for finger in _FINGER_NAMES if short_word.startswith(finger)), "")
    return {"mid": "middle", "little": "pinky"}.get(finger_word, finger_word)


def _split_name(name: str) -> tuple[int, str]:
    """Returns the side of a name (1 left, -1 right, 0 none), and its other words joined in lower case.

    For helper joints, which never belong to a limb, the word is empty.
    """
    bare_name = re.sub(r"^.*[:|]", "", name)
    side, other_words = 0, list[str]()
    parts = [part.lower() for part in _WORD_PATTERN.findall(bare_name)]
    if _HELPER_WORDS.search(" ".join(parts)):
        return 0, ""
    for part in parts:
        if part in _SIDE_OF_WORD:
            side = _SIDE_OF_WORD[part]
        elif part not in _FILLER_WORDS:
            other_words.append(part)
    word = "".join(other_words)
    if not side and word[:1] in ("l", "r") and word[1:] in _LIMB_WORDS:
        return _SIDE_OF_WORD[word[0]], word[1:]
    return side, word


_LIMB_WORDS = frozenset(
    word
    for tiers in (_ELBOW_NAMES, _SHOULDER_NAMES, _WRIST_NAMES, _KNEE_NAMES, _HIP_NAMES, _ANKLE_NAMES)
    for tier in tiers
    for word in tier
)
"""All words for joints of a limb. They are used to separate side letters from words: "lknee" is a left knee,
but "lower" is not a left "ower"."""


def _limb_of_side(
    skeleton: Skeleton,
    words: Sequence[tuple[int, str]],
    side: int,
    starts: Sequence[Sequence[str]],
    middles: Sequence[Sequence[str]],
    ends: Sequence[Sequence[str]],
) -> HumanLimb | None:
    """Finds the limb of one side by the names of its joints. Returns None if the names do not occur."""
    for names in middles:
        middle_joint = _find_first_named_joint(range(len(words)), words, side, (names,))
        ancestors = skeleton.path(0, middle_joint)[:-1] if middle_joint >= 0 else ()
        start_joint = _find_first_named_joint(ancestors, words, side, starts)
        if start_joint >= 0:
            break
    else:
        return None
    descendants = skeleton.list_subtree(middle_joint)[1:]
    end_joint = _find_first_named_joint(descendants, words, side, ends)
    if end_joint < 0:
        end_joint = _find_longest_child(skeleton, middle_joint)
    if end_joint < 0:
        return None
    return HumanLimb((start_joint, middle_joint, end_joint), _limb_tip(skeleton, words, end_joint))


def _find_first_named_joint(
    joints: Iterable[int], words: Sequence[tuple[int, str]], side: int, tiers: Sequence[Sequence[str]]
) -> int:
    """Returns the first joint with a matching name. The tiers of names are tried in order, the least
    ambiguous first. Returns -1 if no name matches.
    """
    joints = tuple(joints)
    for names in tiers:
        for joint in joints:
            if words[joint][0] == side and words[joint][1] in names:
                return joint
    return -1


def _limb_tip(skeleton: Skeleton, words: Sequence[tuple[int, str]], end: int) -> int:
    """Returns the joint at which a hand or foot ends: the middle finger's knuckle or the toes.

    Without such names, it is the first joint of the longest branch that is not a thumb or a helper.
    """
    children = skeleton.children[end]
    named_children = [
        c
        for c in children
        if words[c][1] and (words[c][1] in _TOE_NAMES or _finger_name(words[c][1]) == "middle")
    ]
    candidates = [c for c in children if _finger_name(words[c][1]) != "thumb" and words[c][1]] or list(
        children
    )
    chosen = named_children or sorted(candidates, key=lambda c: -_branch_length(skeleton, c))[:1]
    return chosen[0] if chosen else -1


def _head_chain(
    skeleton: Skeleton, words: Sequence[tuple[int, str]], chest: int
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Returns the chain from the chest to the end of the head, and the joints at which neck and head
    begin."""
    descendants = skeleton.list_subtree(chest)[1:]
    head = _find_first_named_joint(descendants, words, 0, _HEAD_NAMES)
    if head < 0:
        return (), ()
    path = skeleton.path(chest, head)
    neck = _find_first_named_joint(path[1:-1], words, 0, _NECK_NAMES)
    tips = [c for c in skeleton.children[head] if words[c][0] == 0 and words[c][1].endswith(_TIP_WORDS)]
    tip = tips[0] if tips else _find_longest_child(skeleton, head)
    knots = (neck, head) if neck >= 0 else (head,)
    return (path if tip < 0 else (*path, tip)), knots


def _tail_chain(skeleton: Skeleton, words: Sequence[tuple[int, str]], hips: int) -> tuple[int, ...]:
    """Returns the chain of a tail that is attached to the hips or above, along its longest branch."""
    candidates = [child for joint in skeleton.path(0, hips) for child in skeleton.children[joint]]
    tails = [joint for joint in candidates if words[joint][0] == 0 and words[joint][1].startswith("tail")]
    return (int(skeleton.parents[tails[0]]), *find_longest_branch(skeleton, tails[0])) if tails else ()


def find_longest_branch(skeleton: Skeleton, joint: int) -> tuple[int, ...]:
    """Returns the joints from ``joint`` along the longest branch to its end."""
    chain = [joint]
    while skeleton.children[chain[-1]]:
        chain.append(max(skeleton.children[chain[-1]], key=lambda child: _branch_length(skeleton, child)))
    return tuple(chain)


def _find_common_ancestor(skeleton: Skeleton, first: int, second: int) -> int:
    """Returns the nearest common ancestor of two joints."""
    return min(skeleton.path(first, second))


def _find_longest_child(skeleton: Skeleton, joint: int) -> int:
    """Returns the child of a joint with the longest bone, or -1 for a leaf."""
    return max(skeleton.children[joint], key=lambda child: float(skeleton.lengths[child]), default=-1)


def _branch_length(skeleton: Skeleton, joint: int) -> float:
    """Returns the length in metres of the longest branch of a joint, measured from its parent."""
    child_length = max((_branch_length(skeleton, child) for child in skeleton.children[joint]), default=0.0)
    return float(skeleton.lengths[joint]) + child_length
