"""Tests that a baked puppet moves like the puppet, and is cut, merged and exported like any possessed
mesh.
"""

import made_puppets
import numpy as np
import pytest
from lost_shear import measure_lost_shear

from enliven.document.puppet import PuppetLayer
from enliven.errors import InputError
from enliven.examples.baking.frames import SurfaceFrames, evaluate_states
from enliven.examples.baking.settings import BakeSettings
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import build_glb
from enliven.modeling.edits import merge_characters, move_character
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.possessed.pose import graph_pose, graph_vertices
from enliven.modeling.possessed.surgery import cut_graph
from enliven.modeling.puppet.baking import bake_puppet
from enliven.rotation import rotate


@pytest.fixture(scope="module")
def bean():
    return made_puppets.project(layers=(PuppetLayer("dance", offset=0.5),), place=np.array([0.5, 0.0, 1.0]))


@pytest.fixture(scope="module")
def baked(bean):
    return bake_puppet(bean, "bean", 0.2, 2.2, 15.0)


def seen(project, shape_id, time):
    shape = project.graph(shape_id)
    return graph_vertices(shape, *graph_pose(project, shape, time))


def test_a_baked_puppet_is_where_the_puppet_is(bean, baked):
    project, name, error = baked
    assert name == "bean" and not project.puppets and list(project.takes) == ["dance"]
    puppet = bean.puppet("bean")
    times = 0.2 + np.arange(31) / 15
    places, turns, roots = evaluate_states(bean, puppet, times)
    worst = 0.0
    for frame, vertices in enumerate(SurfaceFrames(puppet, places)()):
        expected = rotate(turns[frame], vertices) + roots[frame]
        off = np.linalg.norm(seen(project, name, times[frame]) - expected, axis=1)
        worst = max(worst, off.max())
    assert worst == pytest.approx(error.worst, rel=0.01)
    assert error.worst <= BakeSettings().worst * error.size


def test_original_may_stay_and_bake_settings_apply(bean):
    project, name, rough = bake_puppet(bean, "bean", keep=True, settings=BakeSettings(nodes=6, first=6))
    assert name == "bean 2" and list(project.puppets) == ["bean"] and len(project.graph(name).positions) == 6
    assert rough.rms > 0
    with pytest.raises(InputError, match="no puppet 'pea'"):
        bake_puppet(bean, "pea")


def test_baked_puppet_is_exported_with_its_motion(baked):
    project, name, _ = baked
    performance = sample_performance(project, name, 0.2, 2.2, 15.0)
    assert measure_lost_shear(performance) < 1e-6, "its nodes stretch along axes of their own"
    assert len(build_glb([performance])) > 1000


def test_baked_puppet_is_cut_and_merged_like_possessed_mesh(baked):
    project, name, _ = baked
    middle = seen(project, name, 1.0).mean(0)
    cut, (low, high) = cut_graph(project, name, PlaneCut(middle, [0, 1, 0]), 1.0)
    before = seen(project, name, 1.7)
    after = np.concatenate([seen(cut, part, 1.7) for part in (low, high)])
    near = np.linalg.norm(before[:, None] - after[None], axis=2).min(1)
    assert near.max() < 1e-6
    moved = move_character(cut, high, [0.0, -0.05, 0.0])
    whole = merge_characters(moved, low, high, 1.0)
    assert list(whole.graphs) == [low]
    assert np.isfinite(seen(whole, low, 1.9)).all()
