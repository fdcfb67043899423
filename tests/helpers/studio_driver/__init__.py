"""Drives the studio with a list of an artist's actions, which use the studio's own tools.

    session = [Key("m"), Click(Widget("takes")), Click(JointPlace("tentacle", 0)), Drag(...), Wait(1.0)]
    play(session, HeadlessStage(workspace))   # without a window
    film(session, workspace, path)            # in the real window, recorded as a film: studio_driver.filming

Screen positions are looked up when they are needed: a joint is clicked at its current position.
"""

from studio_driver.actions import STEP, Action, Click, Do, Drag, Key, Name, Say, Wait, play, steps
from studio_driver.headless_stage import HeadlessStage
from studio_driver.places import (
    JointPlace,
    Near,
    OnBone,
    OnLane,
    OnPuppet,
    OnTimeline,
    PerformerJoint,
    Pixel,
    Place,
    SourceJoint,
    Spot,
    Widget,
    where,
)

__all__ = [
    "STEP",
    "Action",
    "Click",
    "Do",
    "Drag",
    "HeadlessStage",
    "JointPlace",
    "Key",
    "Name",
    "Near",
    "OnBone",
    "OnLane",
    "OnPuppet",
    "OnTimeline",
    "PerformerJoint",
    "Pixel",
    "Place",
    "Say",
    "SourceJoint",
    "Spot",
    "Wait",
    "Widget",
    "play",
    "steps",
    "where",
]
