"""Retargets the motion in one file to the model in another file, and writes the result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from enliven.document import Clip
from enliven.exporters import exporter_of, sample_performance
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import Rig
from enliven.mapping.automatic_mapping import (
    RetargetedShape,
    create_automatic_plan,
    list_idle_limbs,
    play_own_take,
)
from enliven.mapping.automatic_mapping import retarget as retarget_shape
from enliven.mapping.model_clips import is_looping, is_own_take
from enliven.mapping.plan import Plan
from enliven.mapping.plan_file import read_plan
from enliven.mapping.quality import (
    MAX_FLOOR_DISTANCE,
    MAX_INTERSECTION,
    MAX_SLIDE_CM_S,
    MAX_STRETCH,
    MotionQuality,
    measure_quality,
)
from enliven.mapping.softening import soften_plan
from enliven.motion_clips.take_files import read_take
from enliven.settings import load_settings, setting

_MAX_DEFAULT_RATE_HZ = 60.0
"""Maximum frame rate of the output if none is chosen, in frames per second: the rate of common displays."""


@dataclass(frozen=True)
class RetargetOptions:
    """Options of the transfer of a motion to a model."""

    mapping: str = setting("", "Path of a mapping file. Empty: the mapping is computed automatically.")
    start: float = setting(0.0, "Start time in the take.", unit="s", low=0.0)
    end: float | None = setting(
        None, "End time in the take. By default, the end of the take.", unit="s", low=0.0
    )
    rest: str = setting(
        "",
        'Reference pose of the take: "mean", "first", "zero", or a time in seconds. Empty: as set '
        "in the mapping.",
    )
    mode: Literal["auto", "pose", "move"] = setting(
        "auto",
        '"pose": copy the performer\'s pose. "move": add the performer\'s movement to the model\'s '
        'rest pose. "auto": choose automatically.',
    )
    travel: bool = setting(False, "Move the model through the world with the performer.")
    pin: bool = setting(False, "With travel: lock feet that stand still, so that they do not slide.")
    floor: bool = setting(True, "Keep the lowest point of a standing model on the floor.")
    steps: bool = setting(
        True, "Make legs that are built differently follow the steps of the performer's feet."
    )
    stretch: bool = setting(False, "Transfer changes of bone length from the take to the model.")
    limits: bool = setting(True, "Limit an animal's joints to the range of its own clips, plus a margin.")
    soften: bool = setting(
        False, "Reduce the motion of limbs, down to 40 %, where the surface would stretch."
    )
    turn: bool = setting(True, "Turn the model with the performer.")
    rate: float | None = setting(
        None,
        "Frames per second of the output. By default, the rate of the take, at most 60.",
        unit="1/s",
        low=1.0,
        high=240.0,
    )
    height: float | None = setting(
        None, "Height of the model. By default, the height is unchanged.", unit="m"
    )
    animation: str = setting(
        "", "Name of an animation in a .glb file or of a person in an .mcap file. Empty: the first one."
    )


@dataclass(frozen=True)
class RetargetedFile:
    """The result of :func:`retarget_file`.

    Attributes:
        retargeted: the shape with its motion.
        rig: the model as read.
        is_own: True if the take is an animation of the model itself, and was copied joint by joint.
        notes: unusual content of both files, one sentence each.
        quality: measures of the motion, or None if ``is_own`` is True.
    """

    retargeted: RetargetedShape
    rig: Rig
    is_own: bool
    notes: tuple[str, ...]
    quality: MotionQuality | None

    @property
    def faults(self) -> list[str]:
        """A sentence for each visible fault of the motion, with the affected joints."""
        if self.quality is None:
            return []
        idle = list_idle_limbs(self.retargeted.clip, self.retargeted.plan)
        return [
            f"the performer's {limb} drives no part of the model" for limb in idle
        ] + describe_exceeded_bounds(self.quality, self.retargeted.plan.pin)


def retarget_file(
    take: Path, model: Path, output: Path, options: RetargetOptions | None = None, rig: Rig | None = None
) -> RetargetedFile:
    """Retargets a motion to a model, writes the result completely or not at all, and measures its quality.

    Args:
        take: the motion: .bvh, .mcap, .glb, .enliven, or CMU's tables (.txt).
        model: the model: .glb, .gltf or .vrm, rigged or not.
        output: path of the output file. Its suffix determines the format.
        rig: the model, scaled to the height in the options, if it was already read.

    Raises:
        InputError: if a file cannot be read, an option is invalid, or the format is unknown.
        ResourceError: if the output cannot be written.
    """
    options = options or RetargetOptions()
    exporter = exporter_of(output)
    clip, take_notes = read_take(take, options.animation or None, options.start, options.end)
    rig = rig or read_gltf(model, height=options.height)
    is_own = _has_no_mapping(options) and is_own_take(clip, rig.shape)
    if is_own:
        retargeted = play_own_take(rig.shape, clip)
    else:
        retargeted = retarget_shape(rig.shape, clip, _choose_plan(options, rig, clip), clips=rig.clips)
    performance = sample_performance(
        retargeted.project,
        retargeted.shape_id,
        0.0,
        retargeted.duration,
        _output_rate(options, clip, retargeted.duration),
        keyed=is_own and exporter.keyed and options.rate is None,
    )
    exporter.save(output, [performance], f"{take.stem} on {model.stem}")
    quality = None if is_own else _measure_quality(retargeted)
    return RetargetedFile(retargeted, rig, is_own, (*take_notes, *rig.notes), quality)


def describe_exceeded_bounds(quality: MotionQuality, pinned: bool) -> list[str]:
    """Returns a sentence for each exceeded bound, with the affected joints.

    Args:
        pinned: True if feet are locked.
    """
    sunk, afloat, feet = quality.sunk or 0.0, quality.afloat or 0.0, ", ".join(quality.feet)
    limbs = ", ".join(f"{limb.limb} {limb.median:.0f}\u00b0" for limb in quality.worst_limbs[:4])
    faults = {
        f"limbs point away from the performer's: {limbs}": bool(limbs),
        f"the surface stretches at {', '.join(quality.joints)} (--soften reduces the motion)": quality.stretch
        > MAX_STRETCH,
        f"the model goes below the floor at {feet}": sunk > MAX_FLOOR_DISTANCE,
        f"the model is above the floor at {feet} while the performer stands": afloat
        > max(MAX_FLOOR_DISTANCE, sunk),
        f"feet slide at {feet}{'' if pinned else ' (--pin locks the feet)'}": (quality.slide or 0.0)
        > MAX_SLIDE_CM_S,
        f"parts of the surface intersect: {', '.join(quality.parts)}": quality.through > MAX_INTERSECTION,
    }
    return [words for words, is_present in faults.items() if is_present]


def _has_no_mapping(options: RetargetOptions) -> bool:
    """Returns True if no option requires a mapping. Then an animation of the model itself can be copied."""
    return not (options.mapping or options.rest or options.mode != "auto" or options.soften)


def _choose_plan(options: RetargetOptions, rig: Rig, clip: Clip) -> Plan:
    """Returns the mapping from the file, or an automatic mapping, changed by the options."""
    plan = read_plan(options.mapping) if options.mapping else create_automatic_plan(clip, rig.shape)
    changes: dict[str, Any] = {
        name: getattr(options, name) or getattr(plan, name) for name in ("travel", "pin", "stretch")
    }
    changes |= {
        name: getattr(options, name) and getattr(plan, name) for name in ("turn", "floor", "steps", "limits")
    }
    if options.rest:
        value = float(options.rest) if _is_number(options.rest) else options.rest
        changes["rest"] = load_settings(Plan, {"rest": value}, where="--rest").rest
    if options.mode != "auto":
        changes["chains"] = tuple(replace(chain, mode=options.mode) for chain in plan.chains)
    plan = replace(plan, **changes)
    return soften_plan(plan, clip, rig.shape) if options.soften else plan


def _output_rate(options: RetargetOptions, clip: Clip, duration: float) -> float:
    """Returns the frame rate of the output. The rate of a loop is adjusted so that the loop ends exactly on a
    frame.
    """
    rate = min(1.0 / clip.step, _MAX_DEFAULT_RATE_HZ) if options.rate is None else options.rate
    if is_looping(clip) and duration > 0.0:
        rate = max(round(duration * rate), 1) / duration
    return rate


def _measure_quality(retargeted: RetargetedShape) -> MotionQuality:
    return measure_quality(
        retargeted.project, retargeted.shape_id, retargeted.clip, retargeted.duration, retargeted.plan
    )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
