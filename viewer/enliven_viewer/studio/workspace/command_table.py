"""The table of commands, from which menus, keys and the help are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from enliven_viewer.studio.perform import PERFORM_ACTIONS
from enliven_viewer.studio.workspace.commands import Commands


@dataclass(frozen=True)
class MenuCommand:
    """A command: its menu, its label, its keys (the first is shown), and its function."""

    menu: str
    label: str
    keys: tuple[str, ...]
    do: Callable[[Commands], object]


MENU_COMMANDS = (
    MenuCommand("File", "New", ("ctrl+n",), lambda d: d.ask("new")),
    MenuCommand("File", "Open...", ("ctrl+o",), lambda d: d.ask("open")),
    MenuCommand("File", "Save", ("ctrl+s",), lambda d: d.ask("save")),
    MenuCommand("File", "Save as...", ("ctrl+shift+s",), lambda d: d.ask("save as")),
    MenuCommand("File", "Export GLB...", ("ctrl+e",), lambda d: d.ask("export")),
    MenuCommand("File", "Save puppet's session...", ("ctrl+shift+e",), lambda d: d.ask("session")),
    MenuCommand("File", "Quit", ("ctrl+q",), lambda d: d.ask("quit")),
    MenuCommand("Edit", "Undo", ("ctrl+z",), lambda d: d.editor.undo()),
    MenuCommand("Edit", "Redo", ("ctrl+shift+z", "ctrl+y"), lambda d: d.editor.redo()),
    MenuCommand("Edit", "Copy shape", ("ctrl+c",), Commands.copy),
    MenuCommand("Edit", "Cut shape out", ("ctrl+x",), Commands.cut_out),
    MenuCommand("Edit", "Paste shape", ("ctrl+v",), Commands.paste),
    MenuCommand("Edit", "Duplicate shape", ("ctrl+d",), Commands.duplicate),
    MenuCommand("Edit", "Copy motion", ("ctrl+shift+c",), Commands.copy_motion),
    MenuCommand("Edit", "Paste motion", ("ctrl+shift+v",), Commands.paste_motion),
    MenuCommand("Edit", "Same motion on equal limbs", ("ctrl+shift+d",), Commands.spread),
    MenuCommand("Edit", "Clear motion", ("ctrl+shift+x",), Commands.clear_motion),
    MenuCommand("Edit", "Pin or free a foot", ("p",), Commands.pin),
    MenuCommand("Edit", "Delete", ("delete", "backspace"), Commands.delete),
    MenuCommand("Shape", "Mirror left to right", ("ctrl+m",), Commands.mirror),
    MenuCommand("Shape", "Larger by a tenth", ("ctrl+equal",), lambda d: d.scale(1.1)),
    MenuCommand("Shape", "Smaller by a tenth", ("ctrl+minus",), lambda d: d.scale(1 / 1.1)),
    MenuCommand("Shape", "Turn left by 15 degrees", ("ctrl+left",), lambda d: d.turn(15.0)),
    MenuCommand("Shape", "Turn right by 15 degrees", ("ctrl+right",), lambda d: d.turn(-15.0)),
    MenuCommand("Shape", "Turn over", ("ctrl+up",), lambda d: d.turn(180.0)),
    MenuCommand("Shape", "Solve its possession again", ("ctrl+shift+p",), Commands.solve_again),
    MenuCommand("Shape", "Make a puppet of it", ("ctrl+p",), lambda d: d.puppets.make()),
    MenuCommand("Shape", "Bake the puppet to a possessed mesh", (), lambda d: d.puppets.bake()),
    MenuCommand("View", "Play or stop", ("space",), Commands.play),
    MenuCommand("View", "A frame back", ("left",), lambda d: d.step(-1)),
    MenuCommand("View", "A frame on", ("right",), lambda d: d.step(1)),
    MenuCommand("View", "To the start", ("home",), lambda d: d.editor.scrub(0.0)),
    MenuCommand("View", "To the end", ("end",), lambda d: d.editor.scrub(d.editor.length)),
    MenuCommand("View", "Frame everything", ("f",), lambda d: d.editor.frame_all()),
    MenuCommand("View", "From the front", ("1",), lambda d: d.editor.camera.face(0.0, 0.0)),
    MenuCommand("View", "From the right", ("3",), lambda d: d.editor.camera.face(np.pi / 2, 0.0)),
    MenuCommand("View", "From the back", ("2",), lambda d: d.editor.camera.face(np.pi, 0.0)),
    MenuCommand("View", "From above", ("7",), lambda d: d.editor.camera.face(0.0, np.pi / 2)),
    MenuCommand("View", "Where most is seen", ("v",), Commands.best_view),
    MenuCommand("View", "Bones", ("b",), Commands.bones),
    MenuCommand("View", "Outline of the key pose before", ("o",), lambda d: d.puppets.outline()),
    MenuCommand("View", "Faces that pass through one another", ("w",), lambda d: d.puppets.warn()),
    *(
        MenuCommand("Perform", one.shown, one.keys, lambda d, one=one: one.do(d.perform))
        for one in PERFORM_ACTIONS
    ),
    MenuCommand("Help", "Keys", ("f1", "h"), lambda d: d.ask("help")),
)
"""Every command."""
