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
            help="Models (glb), meshes (obj, ply, stl, off), takes (bvh, mcap), a project (enliven)."
        ),
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Close the window after this number of seconds.")
    ] = None,
    settings: Annotated[Path | None, typer.Option(help="A TOML file of settings.")] = None,
    fullscreen: Annotated[bool, typer.Option("--fullscreen", help="Fill the screen (F11).")] = False,
) -> None:
    """Sketch, cut and merge shapes, give them motion, and step into them, in a window.

    \b
      enliven studio                     an empty stage: sketch a part with S
      enliven studio SPIDER.glb WALK.bvh a model, and a take to give it
      enliven studio CACTUS.ply WALK.bvh a mesh without a skeleton, to act by examples
      enliven studio SQUID.enliven       go on with a project
      enliven                            the same as enliven studio

    Press F1 in the window for the keys.
    """
    if not has_display():
        raise ResourceError(
            "no display was found to open a window on",
            where="enliven studio",
            mend="Start it where there is a screen, or under xvfb-run.",
        )
    # Heavy modules are imported only here, so that `--help` appears quickly.
    from enliven_viewer.studio import StudioSettings, StudioWindow
    from enliven_viewer.studio.editor import Editor
    from enliven_viewer.studio.workspace import Workspace

    chosen = load_settings(StudioSettings, settings) if settings else StudioSettings()
    workspace = Workspace.new(Editor(chosen))
    for file in files or []:
        workspace.open(file)
    workspace.starting = not files
    if workspace.store.list_recoverable():
        workspace.ask("recover")
    StudioWindow(workspace, opening=WindowStart(full_screen=fullscreen)).run(seconds=seconds)
