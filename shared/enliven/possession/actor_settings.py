"""Settings of a character's approach to its performers, and of the transfer of their motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from enliven.deformation.constraints.floor_contact import FloorSettings
from enliven.deformation.constraints.observed import ObservedSettings
from enliven.deformation.constraints.self_contact import SelfContactSettings
from enliven.deformation.embedded.solver import EmbeddedSettings
from enliven.settings import group, parameter, setting


@dataclass(frozen=True)
class AttachmentSettings:
    """How a body attaches to a mesh."""

    radius: float = parameter(
        0.04, "Radius of the cylinder of sample points around each bone.", unit="m", low=0.0, high=0.5
    )
    along: int = parameter(4, "Number of samples along each bone.", low=1, high=64)
    around: int = parameter(4, "Number of samples around each bone.", low=1, high=64)
    reach: float = setting(
        0.10, "Maximum distance from a sample to the node to which it attaches.", unit="m", low=0.0, high=2.0
    )
    normal_angle: float = parameter(
        math.pi / 2,
        "Maximum angle between the normals of a sample and its node.",
        unit="rad",
        low=0.0,
        high=math.pi,
    )
    joints: bool = parameter(
        True, "Also attaches samples at the joints, in addition to those along the bones."
    )


@dataclass(frozen=True)
class ActorSettings:
    """Settings of a character's approach to its performers, and of the transfer of their motion."""

    place: Literal["meet", "fixed"] = setting(
        "meet",
        "'meet' moves the mesh to the performer's position. 'fixed' leaves the mesh at its modelled "
        "position.",
    )
    stand: Literal["fitted", "modelled"] = setting(
        "fitted",
        "'fitted' moves and turns a mesh from a file until a standing person fits best into it. "
        "'modelled' keeps its origin and front (+Z).",
    )
    how: Literal["inside", "beside", "mapped"] = setting(
        "inside",
        "'inside': the performer stands in the mesh. 'beside': the mesh stays next to the performer "
        "and moves as if the "
        "performer stood in it. 'mapped': like 'beside', but each limb drives a limb of the mesh, "
        "for any shape.",
    )
    aside: float = setting(
        1.2,
        "Distance of the mesh to the performer's left, if the performer does not stand in it.",
        unit="m",
        low=-20.0,
        high=20.0,
    )
    travel: float = setting(
        1.0, "Travel of the mesh over the floor, as a multiple of the performer's travel.", low=0.0, high=10.0
    )
    scaled: Literal["mesh", "performer", "nobody"] = setting(
        "mesh",
        "Scales the 'mesh', or the motion of the 'performer', to match heights. 'nobody' transfers motion "
        "metre for metre.",
    )
    follow: Literal["skeleton", "surface", "both"] = setting(
        "skeleton",
        "Source of the mesh's motion: the tracked skeleton, the surface seen by the depth sensor, or both.",
    )
    meets: bool = setting(
        True,
        "Aligns the limbs of a human-like mesh with those of the performer inside it. If false, bones "
        "attach to the nearest parts of the mesh.",
    )
    ahead: bool = setting(
        True,
        "Poses a human-like mesh like its next performer before the performer attaches. If false, "
        "the mesh keeps its modelled pose.",
    )
    height_ratio: float = setting(
        1.0, "Height of the mesh divided by the performer's height.", low=0.05, high=20.0
    )
    fade: float = setting(
        0.5,
        "Duration of the blend after a performer attaches to or releases the mesh.",
        unit="s",
        low=0.0,
        high=10.0,
    )
    fade_pace: float = parameter(
        2.5,
        "Maximum speed of the blend after such a change. Large changes take longer.",
        unit="m/s",
        low=0.01,
    )
    patience: float = parameter(
        0.2,
        "A performer who is out of sight for longer than this releases the mesh until the performer returns.",
        unit="s",
        low=0.0,
        high=10.0,
    )
    hand_over: float = setting(
        60.0,
        "If a performer is away for longer than this, the only idle performer in view takes over the mesh. 0 "
        "turns this off.",
        unit="s",
        low=0.0,
    )
    enough: float = parameter(
        0.5, "Fraction of a limb's bones that must attach before its reach stops growing.", low=0.0, high=1.0
    )
    farthest_reach: float = parameter(
        0.45,
        "Maximum distance from a bone to the mesh at which the bone can attach.",
        unit="m",
        low=0.0,
        high=5.0,
    )
    attachment: AttachmentSettings = group(AttachmentSettings, "Attachment of bones to the mesh.")
    stiffness: tuple[tuple[float, float, float, float, float], ...] = setting(
        (),
        "Spheres [x, y, z, radius, factor], in metres of the loaded mesh. Factors above 1 make the "
        "mesh inside stiffer, below 1 softer.",
    )
    exaggeration: float = setting(
        1.0,
        "How far soft parts (painted, or `stiffness` below 1) swing past the motion. 0 turns the swing off.",
        low=0.0,
        high=4.0,
    )
    ends: tuple[tuple[float, float, float], ...] = setting(
        (),
        "Ends of head, left hand, right hand, left foot and right foot: [x, y, z] each, in metres of "
        "the loaded mesh. Empty: found automatically.",
    )
    joints: tuple[tuple[float, float, float], ...] = setting(
        (),
        "The 20 joints of a scanned person in their fixed order: [x, y, z] each, in metres of the "
        "loaded mesh. Empty: found from `ends`.",
    )
    embedded: EmbeddedSettings = group(EmbeddedSettings, "Weights and limits of the deformation solver.")
    observed: ObservedSettings = group(ObservedSettings, "How the mesh follows the observed surface.")
    limbs: SelfContactSettings = group(
        SelfContactSettings, "Self-contact: keeps the limbs of the mesh apart."
    )
    floor: FloorSettings = group(FloorSettings, "Floor contact and foot lock of the mesh.")
