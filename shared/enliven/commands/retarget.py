"""The command ``enliven retarget``: transfers a motion from a file to a model from another file, without a
window."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from enliven.commands.example_files import find_sheet_function
from enliven.commands.terminal import say
from enliven.files import require_folder

if TYPE_CHECKING:
    from enliven.document import Clip
    from enliven.formats.rig import Rig
    from enliven.mapping import Mode, MotionQuality, Plan, RetargetedShape


def retarget(
    take: Annotated[Path, typer.Argument(help="The motion: .bvh, .mcap, .glb, or CMU's tables (.txt).")],
    model: Annotated[Path, typer.Argument(help="The model: .glb, .gltf or .vrm, rigged or not.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Output file: .glb, .bvh or .mp4.")],
    mapping: Annotated[
        Path | None, typer.Option("--map", help="A mapping file; without one, a mapping is computed.")
    ] = None,
    write_map: Annotated[
        Path | None, typer.Option(help="Write the mapping that was used, to edit it by hand.")
    ] = None,
    sheet: Annotated[
        Path | None, typer.Option(help="Draw six moments of take and model (needs the viewer's package).")
    ] = None,
    start: Annotated[float, typer.Option(min=0, help="Start time in the take, in seconds.")] = 0.0,
    end: Annotated[float | None, typer.Option(min=0, help="End time in the take, in seconds.")] = None,
    rest: Annotated[
        str | None,
        typer.Option(help='Reference pose of the take: "mean", "first", "zero", or seconds.'),
    ] = None,
    mode: Annotated[
        Literal["auto", "pose", "move"],
        typer.Option(help="Take the performer's pose, or move the model from its own; auto: the likelier."),
    ] = "auto",
    travel: Annotated[
        bool, typer.Option("--travel", help="Let the model go where the performer goes.")
    ] = False,
    pin: Annotated[
        bool, typer.Option("--pin", help="With --travel: hold feet where they stand, against sliding.")
    ] = False,
    floor: Annotated[
        bool,
        typer.Option(help="Keep a standing model on the floor, by its lowest point."),
    ] = True,
    steps: Annotated[
        bool,
        typer.Option(help="Let differently built legs step where the performer's feet step."),
    ] = True,
    stretch: Annotated[
        bool,
        typer.Option("--stretch", help="Stretch the model's bones as the take stretches its bones."),
    ] = False,
    limits: Annotated[
        bool,
        typer.Option(help="Limit an animal's joints to the range of its own clips, plus a margin."),
    ] = True,
    soften: Annotated[
        bool,
        typer.Option("--soften", help="Move limbs less, down to 40 %, where the surface would stretch."),
    ] = False,
    turn: Annotated[bool, typer.Option(help="Let the model turn as the performer turns.")] = True,
    rate: Annotated[
        float | None,
        typer.Option(
            min=1, max=240, help="Frames per second of the output; by default the take's, at most 60."
        ),
    ] = None,
    height: Annotated[
        float | None, typer.Option(help="Height of the model in metres; unchanged by default.")
    ] = None,
    animation: Annotated[
        str | None,
        typer.Option(help="Animation of a .glb or person of an .mcap; by default the first."),
    ] = None,
) -> None:
    """Move a model by a motion: the whole body automatically, or by a mapping file.

    \b
      enliven retarget WALK.bvh HORSE.glb -o out.glb
      enliven retarget WALK.bvh HORSE.glb -o out.glb --sheet out.png --write-map map.toml
      enliven retarget WALK.bvh HORSE.glb -o out.glb --map map.toml --start 1 --end 5
      enliven retarget FOX.glb DEER.glb -o out.glb --animation Run
      enliven retarget JOINTS.mcap SPIDER.glb -o out.glb --travel --pin
    """
    # Heavy modules are imported only here, so that `--help` is quick.
    from enliven.exporters import exporter_of, performance_of
    from enliven.formats.gltf import read_gltf
    from enliven.mapping import is_looping, is_own_take, play_own_take, read_plan, write_plan
    from enliven.mapping import retarget as retarget_shape
    from enliven.takes import read_take

    exporter = exporter_of(output)
    require_folder(sheet, write_map)
    draw = find_sheet_function("motion") if sheet else None
    clip, notes = read_take(take, animation, start, end)
    rig = read_gltf(model, height=height)
    is_own = (
        mapping is None and rest is None and mode == "auto" and not soften and is_own_take(clip, rig.shape)
    )
    plan = (
        None
        if is_own
        else _retarget_plan(
            read_plan(mapping) if mapping else None,
            rig,
            clip,
            rest,
            mode,
            travel,
            turn,
            pin,
            floor,
            steps,
            stretch,
            limits,
            soften,
        )
    )
    for note in (*notes, *rig.notes):
        say(f"enliven: {note}", err=True)
    retargeted = (
        play_own_take(rig.shape, clip) if is_own else retarget_shape(rig.shape, clip, plan, clips=rig.clips)
    )
    keyed = is_own and exporter.keyed and rate is None
    rate = min(1.0 / clip.step, _MAX_DEFAULT_RATE_HZ) if rate is None else rate
    if is_looping(clip) and retargeted.duration > 0.0:
        # A loop must end exactly on a frame, so adjust the rate until the duration is a whole number of
        # frames.
        rate = max(round(retargeted.duration * rate), 1) / retargeted.duration
    performance = performance_of(
        retargeted.project, retargeted.shape_id, 0.0, retargeted.duration, rate, keyed=keyed
    )
    exporter.save(output, [performance], f"{take.stem} on {model.stem}")
    if write_map:
        write_plan(retargeted.plan, write_map)
    if sheet and draw:
        draw(sheet, retargeted, f"{take.stem} on {model.stem}")
    if is_own:
        say(
            f"enliven: the take is the model's own: copied joint by joint, "
            f"{retargeted.duration:.2f} s in {output}"
        )
        return
    modes = {chain.mode for chain in retargeted.plan.chains}
    how = {frozenset({"pose"}): "posed as the performer", frozenset({"move"}): "moved from its own pose"}
    say(
        f"enliven: {len(retargeted.plan.chains)} chains, {how.get(frozenset(modes), 'posed and moved')}, "
        f"{retargeted.duration:.2f} s are in {output}"
    )
    _print_quality(retargeted, rig, write_map)


def _print_quality(retargeted: RetargetedShape, rig: Rig, write_map: Path | None) -> None:
    """Prints the quality of the motion. If it has visible faults, warns and suggests a better mapping."""
    from enliven.mapping import idle_limbs, limb_name, next_best, quality_of, write_plan

    for limb in idle_limbs(retargeted.clip, retargeted.plan):
        mend = "Give it a chain: --write-map writes the mapping to begin with."
        say(f"enliven: the performer's {limb} drives nothing. {mend}", err=True)
    quality = quality_of(
        retargeted.project, retargeted.shape_id, retargeted.clip, retargeted.duration, retargeted.plan
    )
    say(f"enliven: {quality}")
    weight_by_limb = {
        limb_name(c): c.weight for c in retargeted.plan.chains if c.weight < 1.0 and "whole" not in c.role
    }
    if weight_by_limb:
        message = ", ".join(f"{limb} {weight:.0%}" for limb, weight in weight_by_limb.items())
        say(f"enliven: moved less by the mapping: {message}")
    if retargeted.limited:
        count = f"{len(retargeted.limited)} joint{'s' * (len(retargeted.limited) != 1)}"
        message = f"{count} kept within limits (--no-limits frees them): {', '.join(retargeted.limited)}"
        say(f"enliven: {message}")
    faults = _exceeded_bounds(quality, retargeted.plan.pin)
    for message in faults:
        say(f"enliven: {message}", err=True)
    if not faults:
        return
    alternative = next_best(retargeted, rig.shape, quality)
    if alternative is None:
        message = "no other mapping does better: give those joints less weight (--write-map)"
        say(f"enliven: {message}", err=True)
        return
    message = f"the next best mapping, {alternative.how}: {alternative.quality}"
    if write_map:
        alternative_path = write_map.with_suffix(f".next{write_map.suffix}")
        write_plan(alternative.plan, alternative_path)
        message += f": --map {alternative_path}"
    say(f"enliven: {message}", err=True)


def _exceeded_bounds(quality: MotionQuality, pinned: bool) -> list[str]:
    """Returns a sentence for each exceeded bound, with the affected joints. ``pinned`` is True if feet are
    locked."""
    from enliven.mapping import MAX_FLOOR_DISTANCE, MAX_INTERSECTION, MAX_SLIDE_CM_S, MAX_STRETCH

    sunk, afloat, feet = quality.sunk or 0.0, quality.afloat or 0.0, ", ".join(quality.feet)
    limbs = ", ".join(f"{limb.limb} {limb.median:.0f}\u00b0" for limb in quality.worst_limbs[:4])
    faults = {
        f"limbs point away from the performer's: {limbs}": bool(limbs),
        f"the surface stretches at {', '.join(quality.joints)} (--soften moves limbs less)": quality.stretch
        > MAX_STRETCH,
        f"it goes below the floor at {feet}": sunk > MAX_FLOOR_DISTANCE,
        f"it is above the floor at {feet} while the performer stands": afloat > max(MAX_FLOOR_DISTANCE, sunk),
        f"feet slide at {feet}{'' if pinned else ' (--pin holds them)'}": (quality.slide or 0.0)
        > MAX_SLIDE_CM_S,
        f"parts go through one another: {', '.join(quality.parts)}": quality.through > MAX_INTERSECTION,
    }
    return [words for words, is_present in faults.items() if is_present]


_MAX_DEFAULT_RATE_HZ = 60.0
"""Maximum frame rate of a GLB if no rate is chosen, in frames per second: the rate of common displays."""


def _retarget_plan(
    plan: Plan | None,
    rig: Rig,
    clip: Clip,
    rest: str | None,
    mode: Mode | Literal["auto"],
    travel: bool,
    turn: bool,
    pin: bool,
    floor: bool,
    steps: bool,
    stretch: bool,
    limits: bool,
    soften: bool,
) -> Plan:
    """Returns the mapping from the file, or the one found automatically, with the options of the command
    line."""
    from dataclasses import replace

    from enliven.mapping import Plan, automatic, soften_plan
    from enliven.settings import load_settings

    plan = automatic(clip, rig.shape) if plan is None else plan
    changes: dict[str, Any] = {"travel": travel or plan.travel, "turn": turn and plan.turn}
    changes |= {"pin": pin or plan.pin, "floor": floor and plan.floor, "steps": steps and plan.steps}
    changes |= {"stretch": stretch or plan.stretch, "limits": limits and plan.limits}
    if rest is not None:
        value = float(rest) if _is_number(rest) else rest
        changes["rest"] = load_settings(Plan, {"rest": value}, where="--rest").rest
    if mode != "auto":
        changes["chains"] = tuple(replace(chain, mode=mode) for chain in plan.chains)
    plan = replace(plan, **changes)
    return soften_plan(plan, clip, rig.shape) if soften else plan


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
