"""The sessions of AniMesh's figures, played with the studio's own tools in its window, as films.

    make session-films                      all films, into out/sessions
    make session-films ONLY="squid"         some of the films
    python tests/benchmarks/examples/session_films.py --check     without window and film, at full speed
    python tests/benchmarks/examples/session_films.py --small possessed     simpler graphics, to test a
    session

No external data is used: parts are sketched, and motions come from the studio's library.
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "helpers"))

from strokes import limb
from studio_driver import (
    STEP,
    Action,
    Click,
    Do,
    Drag,
    HeadlessStage,
    JointPlace,
    Key,
    Name,
    Near,
    OnBone,
    OnTimeline,
    Pixel,
    Place,
    Say,
    SourceJoint,
    Spot,
    Wait,
    Widget,
    play,
)

from enliven.arrays import Float
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.workspace.workspace import Workspace

OUT = Path(__file__).parents[3] / "out" / "sessions"
Actions = Iterator[Action]
SIZE = StudioSettings(width=1200, height=740)
LARGE = StudioSettings(width=1360, height=820)
"""Window size of sessions with a puppet, in which the performer is shown next to it."""
_PLAIN = RenderSettings(shadow_size=64, contact_size=32, samples=1)
"""Shadow and antialiasing settings for sessions in which image quality does not matter."""


def outline(points: Float, at: tuple[float, float] = (0.0, 0.0), turned: float = 0.0) -> tuple[Place, ...]:
    """Returns a stroke around points (N, 2), metres in the plane z = 0, moved, and rotated by ``turned``
    degrees."""
    angle = np.radians(turned)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    places = points @ turn + at
    step = max(len(places) // 48, 1)
    closed = [*places[::step], places[0]]
    return tuple(Spot(float(x), float(y)) for x, y in closed)


def sketch(name: str, points: tuple[Place, ...], seconds: float = 1.8) -> Actions:
    """Draws a part and names it."""
    yield Key("s")
    yield Drag(points, seconds)
    yield Wait(0.3)
    yield Name(name)


def mapped(take: str, joints: tuple[int, int], shape: str, ends: tuple[int, int]) -> Actions:
    """Maps a chain of a take onto a chain of a shape by clicking both."""
    yield Key("m")
    yield Click(Widget("takes"))
    yield Click(Widget(f"pick {take}"))
    yield Wait(0.3)
    yield from (Click(SourceJoint(joint)) for joint in joints)
    yield from (Click(JointPlace(shape, joint)) for joint in ends)
    yield Wait(0.4)
    yield Key("q")


def watch(seconds: float) -> Actions:
    """Plays for a while, then returns to the start."""
    yield Key("space")
    yield Wait(seconds)
    yield Key("space")
    yield Key("home")


def merged(shape: str, place: JointPlace | OnBone) -> Actions:
    """Drags a shape's root onto a node, or a position on a bone, of another shape."""
    yield Key("g")
    yield Drag((JointPlace(shape, 0), place), 1.1)
    yield Wait(0.3)


def figure_6() -> Actions:
    """Plays (a) to (i): one bone, two nodes, a copy rotated by 180 degrees, merged, cut, merged elsewhere."""
    pill = limb(np.array([[0.0, 0.0], [0.0, 0.72]]), np.array([0.08, 0.065]))
    yield Key("1")
    yield Wait(0.6)
    yield Say("(a)  A shape with a single bone...")
    yield from sketch("chain", outline(pill, (0.0, 0.85)))
    yield Say("(a)  ...and a quarter turn")
    yield Key("m")
    yield Click(Widget("loop"))
    yield from mapped("quarter turn", (0, 1), "chain", (0, 1))
    yield from watch(1.3)
    yield Say("(b)  Two nodes more: the total turn is the same")
    yield Key("i")
    yield Click(OnBone("chain", 1, 0.33))
    yield Click(OnBone("chain", 2, 0.5))
    yield from watch(1.3)
    yield Say("(c)  A copy, turned by half")
    yield Key("q")
    yield Click(JointPlace("chain", 1))
    yield Key("ctrl+d")
    yield Key("ctrl+up")
    yield Wait(0.4)
    yield Say("(d)  Merged: both motions are kept")
    yield from merged("chain 2", JointPlace("chain", 0))
    yield from watch(1.5)
    yield Say("(e)  Cut at another time")
    yield Do(lambda workspace: workspace.editor.scrub(0.7))
    yield Key("c")
    middle = OnBone("chain", 5, 0.5)
    yield Drag((Near(middle, -70, 45), Near(middle, 70, -45)), 0.8)
    yield Say("(f)  Two shapes, both still moving")
    yield Key("g")
    yield from watch(1.5)
    yield Say("(g)  The part goes to another node...")
    yield Do(lambda workspace: workspace.editor.scrub(0.7))
    yield from (Key("ctrl+left") for _ in range(5))
    yield from merged("chain 2", JointPlace("chain", 2))
    yield Say("(h)  ...as it is posed at this time")
    yield Wait(1.2)
    yield Say("(i)  and all motions are kept")
    yield from watch(2.5)
    yield Wait(0.5)


def squid() -> Actions:
    """Sketches and animates a tentacle, copies and rotates it, and merges the copies to a mantle."""
    yield Key("1")
    yield Wait(0.6)
    yield Say("Sketch one tentacle")
    joints = np.array([[0.0, 0.0], [0.0, -0.45], [0.0, -0.9]])
    yield from sketch("tentacle", outline(limb(joints, np.array([0.07, 0.05, 0.018])), (0.45, 1.45)))
    yield Say("Add nodes, so that it can bend")
    yield Key("i")
    yield Click(OnBone("tentacle", 1, 0.5))
    yield Click(OnBone("tentacle", 1, 0.5))
    yield Click(OnBone("tentacle", 3, 0.5))
    yield Click(OnBone("tentacle", 5, 0.5))
    yield Say("Map a wave onto it")
    yield from mapped("wave", (0, 6), "tentacle", (0, -1))
    yield from watch(2.0)
    yield Say("Lean it outwards")
    yield Key("q")
    yield Click(JointPlace("tentacle", 0))
    yield Key("ctrl+left")
    yield Key("ctrl+left")
    yield Say("Sketch a mantle")
    mantle = limb(np.array([[0.0, 0.0], [0.0, 0.3], [0.0, 0.85]]), np.array([0.12, 0.24, 0.04]))
    yield from sketch("mantle", outline(mantle, (-0.45, 1.1)), 2.2)
    yield from framed()
    yield Say("Copy the tentacle with its motion, turn it, merge it to the mantle")
    for number in range(1, 6):
        yield Key("q")
        yield Click(JointPlace("tentacle", 3))
        yield Key("ctrl+d")
        yield from turned("tentacle 2", 60 * number)
        yield from merged("tentacle 2", JointPlace("mantle", 0))
    yield from merged("tentacle", JointPlace("mantle", 0))
    yield Say("Each a little later: its bar is shifted")
    for lane in (1, 2, 3):
        yield Drag((OnTimeline(0.4, lane), OnTimeline(0.4 + 0.25 * lane, lane)), 0.7)
    yield Say("One squid, watertight, six tentacles, every motion kept")
    yield Key("q")
    yield Click(Pixel(0.05, 0.4))
    yield Key("b")
    yield Key("f")
    yield Key("space")
    yield Wait(2.5)
    yield Drag((Pixel(0.2, 0.3), Pixel(0.36, 0.32)), 2.5, button=1)
    yield Wait(3.0)


def mantis() -> Actions:
    """Sketches torso and arm, maps motion onto the arm and copies it. A leg is copied, and cut for the back
    legs.
    """
    yield Key("1")
    yield Wait(0.6)
    yield Say("Sketch the torso")
    spine = np.array([[-0.75, 0.86], [-0.45, 0.84], [0.0, 0.92], [0.22, 1.28], [0.30, 1.42]])
    yield from sketch("mantis", outline(limb(spine, np.array([0.025, 0.11, 0.075, 0.05, 0.085]))), 2.2)
    yield Say("Sketch a front arm")
    arm = np.array([[0.62, 1.40], [0.76, 1.05], [1.08, 1.35], [0.98, 1.00]])
    yield from sketch("arm", outline(limb(arm, np.array([0.062, 0.05, 0.04, 0.016]))), 2.0)
    yield Say("Map a reach onto it")
    yield from mapped("reach", (0, 3), "arm", (0, -1))
    yield from watch(1.8)
    yield Say("Copy it with its motion, turn the two apart, merge them")
    yield from pair("arm", OnBone("mantis", "a1", 0.3), JointPlace("mantis", "a1 node"), 25)
    yield from watch(1.8)
    yield Say("Sketch a leg, and map a walk onto it")
    leg = np.array([[0.72, 0.86], [0.94, 1.10], [1.16, 0.22], [1.27, 0.13]])
    yield from sketch("leg", outline(limb(leg, np.array([0.055, 0.045, 0.024, 0.014]))), 1.8)
    yield from mapped("walk", (0, 3), "leg", (0, -1))
    yield from watch(1.2)
    yield Key("q")
    yield Click(JointPlace("leg", 0))
    yield Key("ctrl+c")
    yield Say("Two of them are the middle legs")
    yield from pair("leg", JointPlace("mantis", "a1"), JointPlace("mantis", "a1"), 60)
    yield Say("Cut a copy: what is cut off makes the back legs")
    yield Key("ctrl+v")
    yield from framed()
    yield Key("c")
    middle = OnBone("leg", "a2", 0.25)
    yield Drag((Near(middle, -13, -2), Near(middle, 22, 3)), 0.8)
    yield Key("q")
    yield Click(JointPlace("leg", 0))
    yield Key("delete")
    yield Click(JointPlace("leg 2", 1))
    yield Name("hind")
    yield from pair("hind", OnBone("mantis", "a2", 0.55), JointPlace("mantis", "a2 node"), 60)
    yield Say("Legs that step in turn: their bars are shifted")
    for lane in (3, 5):
        yield Drag((OnTimeline(0.3, lane), OnTimeline(0.9, lane)), 0.7)
    yield Say("A mantis, made of three sketches")
    yield Key("q")
    yield Click(Pixel(0.05, 0.4))
    yield Key("b")
    yield Key("f")
    yield Key("space")
    yield Wait(2.5)
    yield Drag((Pixel(0.2, 0.3), Pixel(0.36, 0.32)), 2.5, button=1)
    yield Wait(3.0)


def framed() -> Actions:
    """Shows everything in the view, from the front."""
    yield Key("f")
    yield Key("1")
    yield Wait(0.6)


def turned(part: str, degrees: float) -> Actions:
    """Rotates a part about the vertical by Shift-dragging its root."""
    yield Key("r")
    root = JointPlace(part, 0)
    yield Drag((root, Near(root, math.radians(degrees) / 0.01, 0)), 0.7, shift=True)


def pair(part: str, place: OnBone | JointPlace, node: JointPlace, degrees: float) -> Actions:
    """Copies a part and rotates both apart about the vertical. Merges the copy at a position and the part at
    a node.
    """
    yield Key("q")
    yield Click(JointPlace(part, 0))
    yield Key("ctrl+d")
    yield from framed()
    yield from turned(f"{part} 2", degrees)
    yield from merged(f"{part} 2", place)
    yield from turned(part, -degrees)
    yield from merged(part, node)


def cactus(workspace: Workspace, folder: Path) -> Actions:
    """Makes a mesh without a skeleton act by four example poses."""
    from session_cactus import cactus as made

    yield from made(workspace, folder)


SESSIONS: dict[str, Callable[[], Actions]] = {"figure6": figure_6, "squid": squid, "mantis": mantis}


def interleaved(workspace: Workspace, folder: Path) -> Actions:
    """Sketches a creature, performs it, overdubs, cuts and merges it while it plays, and performs again."""
    from session_interleaved import interleaved as sitting

    yield from sitting(workspace, folder)


def possessed(workspace: Workspace, folder: Path) -> Actions:
    """Possesses a chair, overdubs, merges it with a puppet while both play, and performs again."""
    from session_possessed import possessed as sitting

    yield from sitting(workspace, folder)


FILMED: dict[str, Callable[[Workspace, Path], Actions]] = {
    "cactus": cactus,
    "interleaved": interleaved,
    "possessed": possessed,
}
"""Sessions that need the window, since they read positions on the screen."""
PACES = {"interleaved": STEP / 0.25, "possessed": STEP / 0.25}
"""Minimum time of a frame, seconds, in sessions with an edge, which plays in real time."""


def main(arguments: list[str]) -> int:
    """Films the named sessions, or all."""
    check = "--check" in arguments
    all_names = [*SESSIONS, *([] if check else FILMED)]
    names = [name for name in arguments if not name.startswith("-")] or all_names
    unknown = [name for name in names if name not in all_names]
    if unknown:
        print(f"There is no session {unknown[0]!r}. Known: {', '.join(all_names)}.", file=sys.stderr)
        return 2
    if not check and sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        return _run_under_xvfb(arguments)
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            how = SIZE if name in SESSIONS else LARGE
            how = replace(how, render=_PLAIN) if "--small" in arguments else how
            workspace = Workspace.new(Editor(how), Path(folder) / "recovery")
            session = SESSIONS[name]() if name in SESSIONS else FILMED[name](workspace, Path(folder))
            actions = list(session) if name in SESSIONS else session
            if check:
                play(actions, HeadlessStage(workspace))
                summary = f"{len(workspace.editor.history.names)} edits"
            else:
                from studio_driver.filming import film

                pace = PACES.get(name, 0.0)
                summary = f"{film(actions, workspace, OUT / f'{name}.mp4', title=name, pace=pace)} pictures"
            project = workspace.editor.project
            print(f"{name}: {summary}, {len(project.shapes) + len(project.puppets)} shapes", flush=True)
    return 0


def _run_under_xvfb(arguments: list[str]) -> int:
    """Runs the same command on an Xvfb screen."""
    if shutil.which("xvfb-run") is None:
        print("There is no display, and no xvfb-run to make one: apt install xvfb", file=sys.stderr)
        return 4
    command = ["xvfb-run", "-a", "-s", "-screen 0 1400x900x24", sys.executable, __file__, *arguments]
    return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
