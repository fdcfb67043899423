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
    take: Annotated[
        Path,
        typer.Argument(help="Motion file: .bvh, .mcap, .glb, or a table of the CMU motion database (.txt)."),
    ],
    model: Annotated[Path, typer.Argument(help="Model file: .glb, .gltf or .vrm, with or without a rig.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Output file: .glb, .bvh or .mp4.")],
    mapping: Annotated[
        Path | None, typer.Option("--map", help="Mapping file to use. Default: a mapping is computed.")
    ] = None,
    write_map: Annotated[
        Path | None, typer.Option(help="Write the used mapping to this file, so that it can be edited.")
    ] = None,
    sheet: Annotated[
        Path | None,
        typer.Option(
            help="Draw six frames of the motion and the model to this image (needs the viewer's package)."
        ),
    ] = None,
    start: Annotated[
        float, typer.Option(min=0, help="Start of the used part of the motion, in seconds.")
    ] = 0.0,
    end: Annotated[
        float | None, typer.Option(min=0, help="End of the used part of the motion, in seconds.")
    ] = None,
    rest: Annotated[
        str | None,
        typer.Option(help='Reference pose of the motion: "mean", "first", "zero", or a time in seconds.'),
    ] = None,
    mode: Annotated[
        Literal["auto", "pose", "move"],
        typer.Option(
            help=(
                "pose: the model copies the performer's pose. move: the model repeats the performer's "
                "movements from its own pose. auto: the mode is chosen automatically."
            )
        ),
    ] = "auto",
    travel: Annotated[
        bool, typer.Option("--travel", help="Move the model through space along the performer's path.")
    ] = False,
    pin: Annotated[
        bool, typer.Option("--pin", help="With --travel: lock standing feet, so that they do not slide.")
    ] = False,
    floor: Annotated[
        bool,
        typer.Option(help="Keep the lowest point of a standing model on the floor."),
    ] = True,
    steps: Annotated[
        bool,
        typer.Option(
            help="If the legs differ in build, place the model's feet where the performer's feet step."
        ),
    ] = True,
    stretch: Annotated[
        bool,
        typer.Option("--stretch", help="Stretch the model's bones as the take stretches its bones."),
    ] = False,
    limits: Annotated[
        bool,
        typer.Option(help="Limit an animal's joints to the range of the animal's own clips, plus a margin."),
    ] = True,
    soften: Annotated[
        bool,
        typer.Option(
            "--soften", help="Reduce the movement of limbs that would stretch the surface, to 40 % at least."
        ),
    ] = False,
    turn: Annotated[bool, typer.Option(help="Turn the whole model as the performer turns.")] = True,
    rate: Annotated[
        float | None,
        typer.Option(
            min=1,
            max=240,
            help="Frames per second of the output. Default: the rate of the motion, but at most 60.",
        ),
    ] = None,
    height: Annotated[
        float | None, typer.Option(help="Scale the model to this height in metres. Default: unchanged.")
    ] = None,
    animation: Annotated[
        str | None,
        typer.Option(help="Name of an animation in a .glb, or of a person in an .mcap. Default: the first."),
    ] = None,
) -> None:
    """Move a model by a motion. The body parts are matched automatically, or by a mapping file.

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
            "enliven: the motion was made for this model, so it was copied joint by joint. "
            f"{output} contains {retargeted.duration:.2f} s of motion"
        )
        return
    modes = {chain.mode for chain in retargeted.plan.chains}
    texts = {
        frozenset({"pose"}): "in the performer's pose",
        frozenset({"move"}): "moved from the model's own pose",
    }
    print_line(
        f"enliven: {output} contains {retargeted.duration:.2f} s of motion "
        f"({len(retargeted.plan.chains)} chains, "
        f"{texts.get(frozenset(modes), 'in both modes')})"
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
        remedy = "To change this, add a chain for this limb to the mapping file (--write-map)."
        print_line(f"enliven: the performer's {limb} moves no part of the model. {remedy}", err=True)
    print_line(f"enliven: {quality}")
    weight_by_limb = {
        limb_name(c): c.weight for c in retargeted.plan.chains if c.weight < 1.0 and "whole" not in c.role
    }
    if weight_by_limb:
        message = ", ".join(f"{limb} {weight:.0%}" for limb, weight in weight_by_limb.items())
        print_line(f"enliven: limbs with reduced movement: {message}")
    if retargeted.limited:
        count = f"{len(retargeted.limited)} joint{'s' * (len(retargeted.limited) != 1)}"
        message = (
            f"{count} stayed within the joint limits (--no-limits turns them off): "
            f"{', '.join(retargeted.limited)}"
        )
        print_line(f"enliven: {message}")
    faults = describe_exceeded_bounds(quality, retargeted.plan.pin)
    for message in faults:
        print_line(f"enliven: {message}", err=True)
    if not faults:
        return
    alternative = find_better_mapping(retargeted, result.rig.shape, quality)
    if alternative is None:
        message = (
            "no better mapping was found: reduce the weights of the joints with faults in the "
            "mapping file (--write-map)"
        )
        print_line(f"enliven: {message}", err=True)
        return
    message = f"the best alternative mapping, {alternative.how}: {alternative.quality}"
    if write_map:
        alternative_path = write_map.with_suffix(f".next{write_map.suffix}")
        write_plan(alternative.plan, alternative_path)
        message += f": --map {alternative_path}"
    print_line(f"enliven: {message}", err=True)
