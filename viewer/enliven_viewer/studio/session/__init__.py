"""Sessions: what an artist does, as a list of actions that drive the studio's own tools.

    session = [Key("m"), Click(Widget("takes")), Click(Joint("tentacle", 0)), Drag(...), Wait(1.0)]
    play(session, DeskStage(desk))            # without a window, for tests
    film(session, desk, path)                 # in the real window, into a film: enliven_viewer.studio.filming

Places are looked up when they are needed: a joint is clicked where it then is on the screen.
"""

from enliven_viewer.studio.session import actions
from enliven_viewer.studio.session.actions import (
    STEP,
    Action,
    Click,
    Do,
    Drag,
    Key,
    Name,
    Say,
    Wait,
    play,
    steps,
)
from enliven_viewer.studio.session.desk_stage import DeskStage
from enliven_viewer.studio.session.places import (
    Joint,
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
    "DeskStage",
    "Do",
    "Drag",
    "Joint",
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
    "actions",
    "play",
    "steps",
    "where",
]
