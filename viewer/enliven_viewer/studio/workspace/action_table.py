"""The actions of the studio's own menus; menus, keys, buttons, palette and help are made from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from enliven.errors import EnlivenError
from enliven_viewer.studio.actions import Action
from enliven_viewer.studio.curves import CurveInput
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.ghosts import Ghosts
from enliven_viewer.studio.numbers import view_actions
from enliven_viewer.studio.outliner import alone, choosing_actions
from enliven_viewer.studio.preferences import SIZES, Preferences
from enliven_viewer.studio.tools import TOOLS
from enliven_viewer.studio.workspace.clip_actions import clip_actions
from enliven_viewer.studio.workspace.commands import Commands
from enliven_viewer.studio.workspace.files import SAMPLES, add_sample, exportable
from enliven_viewer.studio.workspace.fitting import fitting_actions
from enliven_viewer.studio.workspace.input import ViewportInput
from enliven_viewer.studio.workspace.painting import painting_actions
from enliven_viewer.studio.workspace.take_commands import take_actions

_ALONE = (
    "file.session",
    *(f"motion.{deed}" for deed in ("copy", "paste", "spread", "clear", "pin")),
    *(f"shape.{deed}" for deed in ("solve", "puppet", "bake")),
    "paint.clear",
    "view.best",
)
"""Actions on one shape; where several are chosen they say so."""
_SHIFT = 0.1
"""Seconds by which a key shifts motion in time: seen at once, and fine enough for a chain of copies."""
Ask = Callable[[str], None]
"""Opens a dialogue of the window by its name, or does at once what needs none."""


def studio_actions(
    commands: Commands, user_input: ViewportInput, ask: Ask, preferences: Preferences
) -> Iterator[Action]:
    """Every action of the studio's own menus, in their order."""
    editor = commands.editor
    for action in _every(commands, user_input, ask, preferences):
        yield alone(action, editor) if action.id in _ALONE else action


def _every(
    commands: Commands, user_input: ViewportInput, ask: Ask, preferences: Preferences
) -> Iterator[Action]:
    yield from _file(ask, preferences)
    yield from _out(commands, ask)
    yield from _edit(commands, user_input, ask)
    yield from choosing_actions(commands.editor)
    yield _snap(commands.editor)
    yield from _motion(commands)
    yield from _keys(commands)
    yield from _shape(commands)
    yield from fitting_actions(commands.fitting)
    yield from painting_actions(user_input)
    yield from _tools(user_input)
    yield from clip_actions(commands.clips)
    yield from take_actions(commands.takes)
    yield from _view(commands)
    yield from _cameras(commands)
    yield from view_actions(commands.editor)
    yield from _reading(preferences)
    yield Action("help.palette", "Help", "Find an action...", ("ctrl+k",), lambda: ask("palette"))
    yield Action(
        "help.tour",
        "Help",
        "Take the tour",
        (),
        lambda: ask("tour"),
        about="Three minutes: each step sees what you do, and goes on.",
    )
    yield Action(
        "help.start", "Help", "Start page", (), lambda: ask("start"), about="While nothing is there."
    )
    for name, label in SAMPLES.items():
        do = lambda name=name: add_sample(commands.editor, name)  # noqa: E731
        yield Action(f"sample.{name}", "Help", label, (), do, about="A sample.", apart=name == "cactus")
    yield Action("help.keys", "Help", "Keys", ("f1", "h"), lambda: ask("help"))


def _file(ask: Ask, preferences: Preferences) -> Iterator[Action]:
    def lacks_recent() -> str:
        return "" if preferences.recent else "No file was opened yet. Open one with Ctrl+O."

    yield Action("file.new", "File", "New", ("ctrl+n",), lambda: ask("new"))
    yield Action(
        "file.open",
        "File",
        "Open...",
        ("ctrl+o",),
        lambda: ask("open"),
        about="A project, a model, a mesh, or a take.",
    )
    again = "Open the last again"
    yield Action("file.again", "File", again, ("ctrl+shift+o",), lambda: ask("again"), lacks_recent)
    yield Action("file.save", "File", "Save", ("ctrl+s",), lambda: ask("save"), apart=True)
    yield Action("file.save_as", "File", "Save as...", ("ctrl+shift+s",), lambda: ask("save as"))


def _out(commands: Commands, ask: Ask) -> Iterator[Action]:
    def lacks_export() -> str:
        try:
            exportable(commands.editor.project)
        except EnlivenError as error:
            return f"{error.what[0].upper()}{error.what[1:]}. {error.mend}"
        return ""

    yield Action(
        "file.export",
        "File",
        "Export...",
        ("ctrl+e",),
        lambda: ask("export"),
        lacks_export,
        about="All shapes with their motion, for other programs: GLB, or BVH for one with bones.",
        apart=True,
    )
    yield Action(
        "file.film",
        "File",
        "Film...",
        ("ctrl+shift+f",),
        lambda: ask("film"),
        lacks_export,
        about="All shapes in motion, as an MP4.",
    )
    yield Action(
        "file.session",
        "File",
        "Save the puppet's examples...",
        ("ctrl+shift+e",),
        lambda: ask("session"),
        commands.puppets.lacks_puppet,
        about="Its control points and key poses, in a file that can be read and edited.",
    )
    yield Action(
        "file.preferences", "File", "Preferences...", ("ctrl+comma",), lambda: ask("preferences"), apart=True
    )
    yield Action("file.quit", "File", "Quit", ("ctrl+q",), lambda: ask("quit"), apart=True)


def _edit(commands: Commands, user_input: ViewportInput, ask: Ask) -> Iterator[Action]:
    c, editor = commands, commands.editor
    yield Action("edit.undo", "Edit", "Undo", ("ctrl+z",), editor.undo, c.lacks_undo)
    yield Action("edit.redo", "Edit", "Redo", ("ctrl+shift+z", "ctrl+y"), editor.redo, c.lacks_redo)
    yield Action(
        "edit.history",
        "Edit",
        "History",
        ("ctrl+h",),
        lambda: ask("history"),
        about="Everything that was done; click a step to go there.",
    )
    yield Action("edit.copy", "Edit", "Copy", ("ctrl+c",), c.copy, c.lacks_character, apart=True)
    yield Action("edit.cut_out", "Edit", "Cut out", ("ctrl+x",), c.cut_out, c.lacks_character)
    yield Action("edit.paste", "Edit", "Paste", ("ctrl+v",), c.paste, c.lacks_copied)
    yield Action("edit.duplicate", "Edit", "Duplicate", ("ctrl+d",), c.duplicate, c.lacks_character)
    yield Action(
        "edit.delete",
        "Edit",
        "Delete",
        ("delete", "backspace"),
        c.delete,
        c.lacks_character,
        about="The chosen node, or else the whole shape.",
    )
    yield Action("edit.drop", "Edit", "Drop what was begun", ("escape",), user_input.drop, apart=True)


def _snap(editor: Editor) -> Action:
    def toggle() -> None:
        editor.snapping.on = not editor.snapping.on

    about = "Moves go to a grid of 10 cm and the floor, turns by 15 degrees. Ctrl held does the opposite."
    on = lambda: editor.snapping.on  # noqa: E731
    return Action("edit.snap", "Edit", "Snap", ("shift+n",), toggle, on=on, about=about, apart=True)


def _motion(c: Commands) -> Iterator[Action]:
    yield Action("motion.copy", "Motion", "Copy motion", ("ctrl+shift+c",), c.copy_motion, c.lacks_chain)
    yield Action("motion.paste", "Motion", "Paste motion", ("ctrl+shift+v",), c.paste_motion, c.lacks_motion)
    yield Action(
        "motion.spread",
        "Motion",
        "To equal limbs",
        ("ctrl+shift+d",),
        c.spread,
        c.lacks_limb,
        about="Gives the motion of the chosen limb to all limbs that are equal to it.",
    )
    yield Action(
        "motion.clear",
        "Motion",
        "Clear motion",
        ("ctrl+shift+x",),
        c.clear_motion,
        c.lacks_shape,
        about="Takes all motion off the chosen chain, or off the whole shape.",
    )
    for name, label, seconds in (("later", "Later", _SHIFT), ("earlier", "Earlier", -_SHIFT)):
        yield Action(
            f"motion.{name}",
            "Motion",
            label,
            (f"ctrl+alt+{'right' if seconds > 0 else 'left'}",),
            lambda seconds=seconds: c.shift(seconds),
            c.lacks_playing,
            about="All motion of what is chosen, by a tenth of a second.",
            apart=seconds > 0,
        )
    yield Action("motion.mute", "Motion", "Mute", ("shift+u",), c.mute, c.lacks_playing, c.muted)
    yield Action(
        "motion.pin",
        "Motion",
        "Pin or free a foot",
        ("p",),
        c.pin,
        c.lacks_foot,
        about="A pinned foot stays where it stands while it touches the floor.",
    )


def _keys(c: Commands) -> Iterator[Action]:
    yield Action(
        "motion.keying",
        "Motion",
        "Keys while posing",
        ("shift+k",),
        c.keys.toggle,
        on=lambda: c.editor.keying,
        about="What is posed (R) or moved (G) gets a key at the playhead: a joint, a dot, or the whole.",
        apart=True,
    )
    about = "As the bone, the node or the whole is there now; drag the key in the curves."
    yield Action(
        "motion.key", "Motion", "A key at the playhead", ("ctrl+j",), c.keys.set, c.keys.lacks, about=about
    )
    away = "Remove the key at the playhead"
    yield Action("motion.unkey", "Motion", away, ("ctrl+shift+j",), c.keys.remove, c.keys.lacks_key)


def _shape(c: Commands) -> Iterator[Action]:
    turns = (
        ("left", "Turn left", 15.0, "left"),
        ("right", "Turn right", -15.0, "right"),
        ("over", "Turn over", 180.0, "up"),
    )
    yield Action(
        "shape.mirror",
        "Shape",
        "Mirror",
        ("ctrl+m",),
        c.mirror,
        c.lacks_character,
        about="Left to right, as you look at it.",
    )
    yield Action(
        "shape.larger",
        "Shape",
        "Larger",
        ("ctrl+equal",),
        lambda: c.scale(1.1),
        c.lacks_character,
        about="By a tenth.",
    )
    yield Action(
        "shape.smaller",
        "Shape",
        "Smaller",
        ("ctrl+minus",),
        lambda: c.scale(1 / 1.1),
        c.lacks_character,
        about="By a tenth.",
    )
    for name, label, degrees, key in turns:
        yield Action(
            f"shape.turn_{name}",
            "Shape",
            label,
            (f"ctrl+{key}",),
            lambda degrees=degrees: c.turn(degrees),
            c.lacks_character,
            about=f"By {abs(degrees):.0f} degrees, as you look at it.",
        )
    yield Action(
        "shape.solve",
        "Shape",
        "Possess it again",
        ("ctrl+shift+p",),
        c.solve_again,
        c.lacks_possessed,
        about="The performers take hold of the mesh as it is now, as after a cut.",
        apart=True,
    )
    yield Action(
        "shape.puppet",
        "Shape",
        "Make a puppet of it",
        ("ctrl+p",),
        c.puppets.make,
        c.puppets.lacks_mesh,
        about="A copy that acts by examples: control points and key poses.",
    )
    yield Action(
        "shape.bake",
        "Shape",
        "Bake the puppet",
        (),
        c.puppets.bake,
        c.puppets.lacks_examples,
        about="Makes a possessed mesh of it, which can be cut and merged.",
    )


def _tools(user_input: ViewportInput) -> Iterator[Action]:
    for kind in TOOLS:
        yield Action(
            f"tool.{kind.name}",
            "Tools",
            kind.label,
            (kind.key,),
            lambda name=kind.name: user_input.take(name),
            on=lambda name=kind.name: user_input.tool.name == name,
            icon=kind.icon,
        )


def _view(c: Commands) -> Iterator[Action]:
    editor = c.editor
    yield Action("view.play", "View", "Play or stop", ("space",), c.play, on=lambda: editor.playing)
    yield Action("view.frame_back", "View", "A frame back", ("left",), lambda: c.step(-1))
    yield Action("view.frame_on", "View", "A frame on", ("right",), lambda: c.step(1))
    yield Action("view.start", "View", "To the start", ("home",), lambda: editor.scrub(0.0))
    yield Action("view.end", "View", "To the end", ("end",), lambda: editor.scrub(editor.length))
    yield Action("view.bones", "View", "Bones", ("b",), c.bones, on=lambda: editor.show_bones, apart=True)
    yield Action(
        "view.outline",
        "View",
        "Outline of the key pose before",
        ("o",),
        c.puppets.outline,
        on=lambda: editor.puppets.silhouette,
        about="While a key pose is edited.",
    )
    yield Action(
        "view.crossing",
        "View",
        "Faces that cross",
        ("w",),
        c.puppets.warn,
        on=lambda: editor.puppets.warn,
        about="Faces that pass through one another are red while a key pose is edited.",
    )


def _reading(preferences: Preferences) -> Iterator[Action]:
    def at_end(size: float, said: str) -> str:
        return f"The text is as {said} as it gets." if preferences.text_size == size else ""

    yield Action(
        "view.larger_text",
        "View",
        "Larger text",
        ("ctrl+shift+equal",),
        lambda: preferences.resize(1),
        lambda: at_end(SIZES[-1], "large"),
        about="Text, and everything around it.",
        apart=True,
    )
    yield Action(
        "view.smaller_text",
        "View",
        "Smaller text",
        ("ctrl+shift+minus",),
        lambda: preferences.resize(-1),
        lambda: at_end(SIZES[0], "small"),
        about="Text, and everything around it.",
    )
    yield Action(
        "view.less_motion",
        "View",
        "Less motion",
        (),
        preferences.calm,
        on=lambda: preferences.less_motion,
        about="The view turns at once, without gliding.",
    )
    yield Action(
        "view.performer",
        "View",
        "Performers in the corner",
        ("alt+p",),
        preferences.watch_performer,
        on=lambda: preferences.performer,
        about="As their camera sees them, each camera's beside the other's.",
    )


def _cameras(c: Commands) -> Iterator[Action]:
    editor, right = c.editor, np.pi / 2
    yield Action(
        "view.all", "View", "Frame everything", ("f",), lambda: editor.frame_all(reset=False), apart=True
    )
    yield Action(
        "view.way",
        "View",
        "Frame the whole way",
        ("ctrl+f",),
        editor.frame_way,
        about="All places that the chosen shape, or else all, come to while they play.",
    )
    yield Action(
        "view.follow",
        "View",
        "Follow what moves",
        ("shift+f",),
        editor.moves.toggle_follow,
        on=lambda: editor.moves.follow,
        about="The view goes along with the chosen character, or with all, from the side that you chose.",
    )
    yield Action(
        "view.turntable",
        "View",
        "Turntable",
        ("shift+t",),
        editor.moves.toggle_turntable,
        on=lambda: editor.moves.turntable,
        about="The view goes around slowly.",
    )
    yield Action(
        "view.look",
        "View",
        "Next look",
        ("shift+l",),
        editor.next_look,
        about="Another light, backdrop and floor: studio, night, white, dawn, garden.",
    )
    sides = (
        ("front", "1", 0.0, 0.0),
        ("back", "2", np.pi, 0.0),
        ("right", "3", right, 0.0),
        ("above", "7", 0.0, right),
    )
    for name, key, around, up in sides:
        label = "From above" if name == "above" else f"From the {name}"
        face = lambda to=(around, up): editor.camera.face(*to)  # noqa: E731
        yield Action(f"view.{name}", "View", label, (key,), face, group="From a side")
    yield Action(
        "view.best",
        "View",
        "Where most is seen",
        ("v",),
        c.best_view,
        c.lacks_shape,
        group="From a side",
        about="Turns the view so that the bones of the chosen shape hide one another least.",
    )


def ghost_action(ghosts: Ghosts) -> Action:
    """The switch of ghosts and trails."""
    return Action(
        "view.ghosts",
        "View",
        "Ghosts and trails",
        ("shift+g",),
        ghosts.toggle,
        on=lambda: ghosts.on,
        about="Where the chosen shape was (blue) and will be (orange), and the ways of its hands and feet.",
        apart=True,
    )


def curve_action(curves: CurveInput) -> Action:
    """The switch of the curves."""
    return Action(
        "view.curves",
        "View",
        "Curves",
        ("shift+c",),
        curves.toggle,
        on=lambda: curves.on,
        about="Turn, place, keys, weight and speed of what is chosen, over time, above the timeline.",
    )
