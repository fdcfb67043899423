"""The table of commands, from which menus, keys and the help are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from enliven_viewer.studio.workspace.commands import Deeds


@dataclass(frozen=True)
class Deed:
    """A command: the menu that it is in, its label, its keys (the first is shown), and what it does."""

    menu: str
    label: str
    keys: tuple[str, ...]
    do: Callable[[Deeds], object]


DEEDS = (
    Deed("File", "New", ("ctrl+n",), lambda d: d.ask("new")),
    Deed("File", "Open...", ("ctrl+o",), lambda d: d.ask("open")),
    Deed("File", "Save", ("ctrl+s",), lambda d: d.ask("save")),
    Deed("File", "Save as...", ("ctrl+shift+s",), lambda d: d.ask("save as")),
    Deed("File", "Export GLB...", ("ctrl+e",), lambda d: d.ask("export")),
    Deed("File", "Save puppet's session...", ("ctrl+shift+e",), lambda d: d.ask("session")),
    Deed("File", "Quit", ("ctrl+q",), lambda d: d.ask("quit")),
    Deed("Edit", "Undo", ("ctrl+z",), lambda d: d.editor.undo()),
    Deed("Edit", "Redo", ("ctrl+shift+z", "ctrl+y"), lambda d: d.editor.redo()),
    Deed("Edit", "Copy shape", ("ctrl+c",), Deeds.copy),
    Deed("Edit", "Cut shape out", ("ctrl+x",), Deeds.cut_out),
    Deed("Edit", "Paste shape", ("ctrl+v",), Deeds.paste),
    Deed("Edit", "Duplicate shape", ("ctrl+d",), Deeds.duplicate),
    Deed("Edit", "Copy motion", ("ctrl+shift+c",), Deeds.copy_motion),
    Deed("Edit", "Paste motion", ("ctrl+shift+v",), Deeds.paste_motion),
    Deed("Edit", "Same motion on equal limbs", ("ctrl+shift+d",), Deeds.spread),
    Deed("Edit", "Clear motion", ("ctrl+shift+x",), Deeds.clear_motion),
    Deed("Edit", "Pin or free a foot", ("p",), Deeds.pin),
    Deed("Edit", "Delete", ("delete", "backspace"), Deeds.delete),
    Deed("Shape", "Mirror left to right", ("ctrl+m",), Deeds.mirror),
    Deed("Shape", "Larger by a tenth", ("ctrl+equal",), lambda d: d.scale(1.1)),
    Deed("Shape", "Smaller by a tenth", ("ctrl+minus",), lambda d: d.scale(1 / 1.1)),
    Deed("Shape", "Turn left by 15 degrees", ("ctrl+left",), lambda d: d.turn(15.0)),
    Deed("Shape", "Turn right by 15 degrees", ("ctrl+right",), lambda d: d.turn(-15.0)),
    Deed("Shape", "Turn over", ("ctrl+up",), lambda d: d.turn(180.0)),
    Deed("Shape", "Make a puppet of it", ("ctrl+p",), lambda d: d.puppets.make()),
    Deed("Shape", "Bake the puppet to a possessed mesh", (), lambda d: d.puppets.bake()),
    Deed("View", "Play or stop", ("space",), Deeds.play),
    Deed("View", "A frame back", ("left",), lambda d: d.step(-1)),
    Deed("View", "A frame on", ("right",), lambda d: d.step(1)),
    Deed("View", "To the start", ("home",), lambda d: d.editor.scrub(0.0)),
    Deed("View", "To the end", ("end",), lambda d: d.editor.scrub(d.editor.length)),
    Deed("View", "Frame everything", ("f",), lambda d: d.editor.frame_all()),
    Deed("View", "From the front", ("1",), lambda d: d.editor.camera.face(0.0, 0.0)),
    Deed("View", "From the right", ("3",), lambda d: d.editor.camera.face(np.pi / 2, 0.0)),
    Deed("View", "From the back", ("2",), lambda d: d.editor.camera.face(np.pi, 0.0)),
    Deed("View", "From above", ("7",), lambda d: d.editor.camera.face(0.0, np.pi / 2)),
    Deed("View", "Where most is seen", ("v",), Deeds.best_view),
    Deed("View", "Bones", ("b",), Deeds.bones),
    Deed("View", "Outline of the key pose before", ("o",), lambda d: d.puppets.outline()),
    Deed("View", "Faces that pass through one another", ("w",), lambda d: d.puppets.warn()),
    Deed("Help", "Keys", ("f1", "h"), lambda d: d.ask("help")),
)
"""Every command."""
