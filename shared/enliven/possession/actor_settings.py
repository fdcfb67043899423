"""Settings for how a character approaches and follows its performers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.deformation.constraints import FloorSettings, ObservedSettings, SelfContactSettings
from enliven.deformation.embedded import EmbeddedSettings
from enliven.possession.attachment import AttachmentSettings
from enliven.settings import setting


@dataclass(frozen=True)
class ActorSettings:
    """Settings for how a character approaches its performers."""

    place: Literal["meet", "fixed"] = setting(
        "meet", "'meet' puts the mesh where the performer stands, 'fixed' leaves it as modelled."
    )
    stand: Literal["fitted", "modelled"] = setting(
        "fitted",
        "'fitted' moves and turns a mesh from a file until a standing person fits into it best; 'modelled' "
        "keeps its own origin and front (+Z).",
    )
    how: Literal["inside", "beside", "mapped"] = setting(
        "inside",
        "'inside': the performer stands in the mesh; 'beside': the mesh stays where it stands and moves as "
        "if the performer stood in it; 'mapped': so too, but limb drives limb, whatever the mesh's shape.",
    )
    aside: float = setting(
        1.2,
        "Distance to the performer's left of a mesh that the performer does not stand in.",
        unit="m",
        low=-20.0,
        high=20.0,
    )
    travel: float = setting(
        1.0, "Share of the performer's travel over the floor that the mesh makes too.", low=0.0, high=10.0
    )
    scaled: Literal["mesh", "performer", "nobody"] = setting(
        "mesh",
        "What is scaled to the other's height: the mesh or the performer's moves; 'nobody': metre for metre.",
    )
    follow: Literal["skeleton", "surface", "both"] = setting(
        "skeleton",
        "What drives the mesh: the tracked bones, the surface that the depth sensor sees, or both.",
    )
    meets: bool = setting(
        True,
        "A human-like mesh that its performer stands in brings its limbs to theirs as they take hold; false: "
        "bones hold what is near them.",
    )
    ahead: bool = setting(
        True,
        "Such a mesh comes to the pose of its next performer before it is first held; false: it waits "
        "as modelled.",
    )
    height_ratio: float = setting(1.0, "The mesh's height over the performer's.", low=0.05, high=20.0)
    fade: float = setting(0.5, "Time to ease over any change of who holds.", unit="s", low=0.0, high=10.0)
    fade_pace: float = setting(
        2.5, "Fastest that easing moves anything: a wide change takes longer.", unit="m/s", low=0.01
    )
    patience: float = setting(
        0.2, "A performer out of sight for longer lets go until they are back.", unit="s", low=0.0, high=10.0
    )
    hand_over: float = setting(
        60.0,
        "A performer away for longer loses the hold to the only idle one in view; 0: never.",
        unit="s",
        low=0.0,
    )
    enough: float = setting(
        0.5, "Share of a limb's bones that must take hold before its reach stops growing.", low=0.0, high=1.0
    )
    farthest_reach: float = setting(0.45, "Longest reach that is tried.", unit="m", low=0.0, high=5.0)
    attachment: AttachmentSettings = setting(AttachmentSettings, "How bones take hold.")
    stiffness: tuple[tuple[float, float, float, float, float], ...] = setting(
        (),
        "Spots [x, y, z, radius, factor] of the mesh as it is cast, in metres; a factor above 1 bends less, "
        "below 1 gives way.",
    )
    exaggeration: float = setting(
        1.0,
        "How far soft parts, painted or of `stiffness` below 1, swing past the motion; 0: not at all.",
        low=0.0,
        high=4.0,
    )
    ends: tuple[tuple[float, float, float], ...] = setting(
        (),
        "The ends of head, left hand, right hand, left foot and right foot, [x, y, z] each in "
        "metres of the mesh as it is cast; none: they are found.",
    )
    joints: tuple[tuple[float, float, float], ...] = setting(
        (),
        "The 20 joints of a person who was scanned, in their order, [x, y, z] each in metres of the "
        "mesh as it is cast; none: they are found by the ends.",
    )
    embedded: EmbeddedSettings = setting(EmbeddedSettings, "The deformation's weights.")
    observed: ObservedSettings = setting(ObservedSettings, "How the surface follows what is seen.")
    limbs: SelfContactSettings = setting(SelfContactSettings, "How the mesh's limbs keep out of each other.")
    floor: FloorSettings = setting(FloorSettings, "What the mesh does on the floor.")
