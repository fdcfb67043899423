"""enliven studio: the editor's window."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from enliven.errors import ResourceError
from enliven.settings import load_settings
from enliven_viewer.doctor import has_display
from enliven_viewer.settings import WindowStart


def studio(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Files to open: models (glb), meshes (obj, ply, stl, off), takes (bvh, mcap), "
            "a project (enliven)."
        ),
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Close the window after this number of seconds.")
    ] = None,
    space: Annotated[
        Path | None,
        typer.Option(help="Space file of enliven calibrate, which places several edges in one space."),
    ] = None,
    out: Annotated[
        list[str] | None,
        typer.Option(
            help="Send the shown motion live to another program: vmc:HOST[:PORT], vrchat:, rokoko: or osc:. "
            "Or let Foxglove connect to this computer: foxglove:127.0.0.1. Repeat the option for several."
        ),
    ] = None,
    settings: Annotated[Path | None, typer.Option(help="A TOML file of settings.")] = None,
    fullscreen: Annotated[bool, typer.Option("--fullscreen", help="Start in full screen (F11).")] = False,
) -> None:
    """Sketch, cut and merge shapes, animate them, and control them with your body, in a window.

    \b
      enliven studio                     an empty stage: sketch a part with S
      enliven studio SPIDER.glb WALK.bvh a model, and a take that moves it
      enliven studio CACTUS.ply WALK.bvh a mesh without a skeleton: animate it by example poses
      enliven studio SQUID.enliven       continue a project
      enliven studio DANCE.enliven --out vmc:127.0.0.1  stream it into Unreal, VSeeFace or Blender
      enliven                            the same as enliven studio

    Press F1 in the window for the keyboard shortcuts.
    """
    if not has_display():
        raise ResourceError(
            "no display was found for the window",
            where="enliven studio",
            remedy="Start enliven studio on a computer with a screen, or with xvfb-run.",
        )
    # Heavy modules are imported only here, so that `--help` appears quickly.
    from enliven.outputs.opening import open_outputs
    from enliven.outputs.settings import collect_output_settings
    from enliven.space.space_file import load_space
    from enliven_viewer.studio.editor.editor import Editor
    from enliven_viewer.studio.features.perform.session import PerformSession
    from enliven_viewer.studio.settings import StudioSettings
    from enliven_viewer.studio.window.live_outputs import WindowOutputs
    from enliven_viewer.studio.window.window import StudioWindow
    from enliven_viewer.studio.workspace.workspace import Workspace

    chosen_settings = load_settings(StudioSettings, settings) if settings else StudioSettings()
    loaded_space = None if space is None else load_space(space)
    workspace = Workspace.new(Editor(chosen_settings))
    workspace.state(PerformSession).shared_space.space = loaded_space
    for file in files or []:
        workspace.open(file)
    workspace.starting = not files
    if workspace.store.list_recoverable():
        workspace.open_dialogue("recover")
    outputs = collect_output_settings(out or [], chosen_settings.outputs)
    opened = open_outputs(outputs, settings.parent if settings else None)
    with WindowOutputs(workspace, opened) as sending:
        opening = WindowStart(full_screen=fullscreen)
        StudioWindow(workspace, opening=opening, outputs=sending).run(seconds=seconds)
