from .body_take import (
    BodyTake as BodyTake,
    HoldChange as HoldChange,
    HoldMode as HoldMode,
    Possession as Possession,
)
from .character import Character as Character, Pose as Pose, SkinWeights as SkinWeights
from .clip import (
    Clip as Clip,
    CubicKeys as CubicKeys,
    FineFrames as FineFrames,
    joint_places as joint_places,
    clip_from_keys as clip_from_keys,
    apply_stretch as apply_stretch,
)
from .constraints import (
    Constraint as Constraint,
    Coupling as Coupling,
    Position as Position,
    Velocity as Velocity,
    list_names_in as list_names_in,
)
from .example_settings import ExampleSettings as ExampleSettings
from .history import History as History
from .layers import (
    FEET as FEET,
    STILL as STILL,
    Layer as Layer,
    Ref as Ref,
    RootLayer as RootLayer,
    Span as Span,
)
from .locomotion import Kind as Kind, LocomotionSettings as LocomotionSettings, Switch as Switch
from .pin import ContactSettings as ContactSettings, Pin as Pin
from .graph.layers import GraphLayer as GraphLayer, GraphPart as GraphPart, Ride as Ride
from .graph.shape import (
    GraphCharacter as GraphCharacter,
    character_from_graph_shape as character_from_graph_shape,
    graph_shape_at_rest as graph_shape_at_rest,
    graph_shape_from_poses as graph_shape_from_poses,
)
from .graph.stream import PoseStream as PoseStream, make_keyed_stream as make_keyed_stream
from .keys import (
    EASES as EASES,
    CurveKey as CurveKey,
    KEY_STEP as KEY_STEP,
    MotionKey as MotionKey,
    curve_from_keys as curve_from_keys,
    key_values as key_values,
    sort_keys as sort_keys,
    interpolate_keys as interpolate_keys,
)
from .project import (
    CameraMark as CameraMark,
    FREE as FREE,
    DisplayState as DisplayState,
    Marker as Marker,
    Project as Project,
    are_identical as are_identical,
)
from .naming import unused as unused
from .props import BALL as BALL, BOX as BOX, Props as Props
from .puppet import (
    ControlPoint as ControlPoint,
    KeyPose as KeyPose,
    Plane as Plane,
    ExampleCharacter as ExampleCharacter,
    PuppetLayer as PuppetLayer,
    character_from_puppet as character_from_puppet,
)
from .rig import RigBase as RigBase
from .rigged import (
    RiggedCharacter as RiggedCharacter,
    character_of as character_of,
    bones_to_draw as bones_to_draw,
    still_shape as still_shape,
)
from .skeleton import Skeleton as Skeleton, skeleton_from_links as skeleton_from_links
from .surface_settings import ArapSettings as ArapSettings
from .smoothing import smooth_take as smooth_take
from .time_map import (
    MAX_SPEED as MAX_SPEED,
    MIN_SPEED as MIN_SPEED,
    Moment as Moment,
    LayerBase as LayerBase,
    Segment as Segment,
    TimeMap as TimeMap,
    compute_closing_time as compute_closing_time,
    ease_in_out as ease_in_out,
    find_clip_run as find_clip_run,
)
