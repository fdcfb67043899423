"""The command ``enliven retarget``: transfers a motion from a file to a model from another file, without a
window."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from enliven.commands.terminal import print_line
from enliven.files import require_folder

if TYPE_CHECKING:
    from enliven.mapping.quality import MotionQuality
    from enliven.oneshot.retargeting import RetargetedFile


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
    # Import large modules only here, so that `--help` is fast.
    from enliven.exporters import find_sheet_function
    from enliven.mapping.plan_file import write_plan
    from enliven.oneshot.retargeting import RetargetOptions, retarget_file

    require_folder(sheet, write_map)
    draw = find_sheet_function("motion") if sheet else None
    result = retarget_file(
        take,
        model,
        output,
        RetargetOptions(
            mapping=str(mapping or ""),
            start=start,
            end=end,
            rest=rest or "",
            mode=mode,
            travel=travel,
            pin=pin,
            floor=floor,
            steps=steps,
            stretch=stretch,
            limits=limits,
            soften=soften,
            turn=turn,
            rate=rate,
            height=height,
            animation=animation or "",
        ),
    )
    retargeted = result.retargeted
    for note in result.notes:
        print_line(f"enliven: {note}", err=True)
    if write_map:
        write_plan(retargeted.plan, write_map)
    if sheet and draw:
        draw(sheet, retargeted, f"{take.stem} on {model.stem}")
    if result.quality is None:
        print_line(
            f"enliven: the take is the model's own: copied joint by joint, "
            f"{retargeted.duration:.2f} s in {output}"
        )
        return
    modes = {chain.mode for chain in retargeted.plan.chains}
    texts = {
        frozenset({"pose"}): "posed as the performer",
        frozenset({"move"}): "moved from its own pose",
    }
    print_line(
        f"enliven: {len(retargeted.plan.chains)} chains, {texts.get(frozenset(modes), 'posed and moved')}, "
        f"{retargeted.duration:.2f} s are in {output}"
    )
    _print_quality(result, result.quality, write_map)


def _print_quality(result: RetargetedFile, quality: MotionQuality, write_map: Path | None) -> None:
    """Prints the quality of the motion. If it has visible faults, warns and suggests a better mapping."""
    from enliven.mapping.alternatives import find_better_mapping
    from enliven.mapping.automatic_mapping import list_idle_limbs
    from enliven.mapping.plan_file import write_plan
    from enliven.mapping.softening import limb_name
    from enliven.oneshot.retargeting import describe_exceeded_bounds

    retargeted = result.retargeted
    for limb in list_idle_limbs(retargeted.clip, retargeted.plan):
        remedy = "Give it a chain: --write-map writes the mapping to begin with."
        print_line(f"enliven: the performer's {limb} drives nothing. {remedy}", err=True)
    print_line(f"enliven: {quality}")
    weight_by_limb = {
        limb_name(c): c.weight for c in retargeted.plan.chains if c.weight < 1.0 and "whole" not in c.role
    }
    if weight_by_limb:
        message = ", ".join(f"{limb} {weight:.0%}" for limb, weight in weight_by_limb.items())
        print_line(f"enliven: moved less by the mapping: {message}")
    if retargeted.limited:
        count = f"{len(retargeted.limited)} joint{'s' * (len(retargeted.limited) != 1)}"
        message = f"{count} kept within limits (--no-limits frees them): {', '.join(retargeted.limited)}"
        print_line(f"enliven: {message}")
    faults = describe_exceeded_bounds(quality, retargeted.plan.pin)
    for message in faults:
        print_line(f"enliven: {message}", err=True)
    if not faults:
        return
    alternative = find_better_mapping(retargeted, result.rig.shape, quality)
    if alternative is None:
        message = "no other mapping does better: give those joints less weight (--write-map)"
        print_line(f"enliven: {message}", err=True)
        return
    message = f"the next best mapping, {alternative.how}: {alternative.quality}"
    if write_map:
        alternative_path = write_map.with_suffix(f".next{write_map.suffix}")
        write_plan(alternative.plan, alternative_path)
        message += f": --map {alternative_path}"
    print_line(f"enliven: {message}", err=True)
