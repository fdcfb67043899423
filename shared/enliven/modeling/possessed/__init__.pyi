from .another_mesh import possess_another as possess_another
from .even_steps import between as between, even_times as even_times, stream_of as stream_of
from .following import find_followers as find_followers
from .pose import (
    graph_pose as graph_pose,
    graph_vertices as graph_vertices,
    over_base as over_base,
    pose_of_graph as pose_of_graph,
    within_layer as within_layer,
)
from .rig import GraphRig as GraphRig
from .solving import (
    mark_as_solved as mark_as_solved,
    possess_mesh as possess_mesh,
    solve_again as solve_again,
    solve_lost as solve_lost,
    stale as stale,
    has_missing_motion as has_missing_motion,
    with_possession as with_possession,
)
from .surgery import cut_graph as cut_graph
