"""enliven graph: an image of the deformation graph of any mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from enliven.commands.terminal import print_line
from enliven.errors import InputError
from enliven.files import require_folder

CHAIR = "chair"
_MAX_EDGE_M = 0.04
"""Maximum length of a mesh edge in metres after refinement. The edge program uses the same value, so that
both programs build the same graph.
"""
_IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")


def graph(
    mesh: Annotated[str, typer.Argument(help='A mesh file, or "chair" for the sample chair.')],
    output: Annotated[Path, typer.Option("--output", "-o", help="Output image: png, jpg or webp.")],
    nodes: Annotated[int, typer.Option(min=1, max=65535, help="Number of graph nodes.")] = 128,
    radius: Annotated[
        float | None, typer.Option(help="Distance between graph nodes in metres. Replaces --nodes.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Random seed for the positions of the nodes.")] = 0,
    up: Annotated[Literal["x", "y", "z"], typer.Option(help="Axis of the mesh that points up.")] = "y",
    height: Annotated[
        float, typer.Option(help="Scale the mesh to this height in metres. 0 keeps the size of the file.")
    ] = 1.75,
    size: Annotated[
        int, typer.Option(min=160, max=4096, help="Width in pixels of each of the three views.")
    ] = 640,
) -> None:
    """Draw the deformation graph of a mesh, seen from three sides.

    \b
      enliven graph HORSE.obj -o horse.png
      enliven graph chair -o chair.png --nodes 256
      enliven graph SCAN.ply -o scan.png --up z --radius 0.1

    The image marks the cut vertices and bridges of the graph. KinEtre's rigidity energy E_rig acts there.
    """
    if output.suffix.lower() not in _IMAGE_SUFFIXES:
        endings = ", ".join(ending[1:] for ending in _IMAGE_SUFFIXES)
        raise InputError(
            f"images with the extension {output.suffix or '(none)'} cannot be written",
            where=str(output),
            remedy=f"Use one of these file extensions: {endings}.",
        )
    require_folder(output)
    # Heavy modules are imported only here, so that `--help` appears quickly.
    from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
    from enliven.meshes import fit_height, load_mesh, refine
    from enliven.samples.shipped import load_sample
    from enliven_viewer.film.graph_picture import write_graph_picture

    if mesh == CHAIR:
        shape = load_sample("chair")
    else:
        shape, notes = load_mesh(mesh)
        for note in notes:
            print_line(f"enliven: {note}", err=True)
        if height != 0:
            shape = refine(fit_height(shape, height, up), _MAX_EDGE_M * height / 1.75)
    deformation_graph = DeformationGraph.build(shape, nodes=nodes, seed=seed, radius=radius)
    name = CHAIR if mesh == CHAIR else Path(mesh).name
    counts = write_graph_picture(
        output,
        character_from_graph(shape, deformation_graph, name),
        deformation_graph,
        name,
        (size, size * 5 // 4),
    )
    print_line(
        f"enliven: wrote {output}: {counts.nodes} nodes, {counts.edges} edges, {counts.bridges} bridges, "
        f"{counts.cut_vertices} cut vertices"
    )
