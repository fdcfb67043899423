"""Tests of puppets as GLB: valid files whose surface, played by an independent reader, is the solved one."""

import made_puppets
import numpy as np
import pytest
from slow_gltf import SlowGltf
from strict_gltf import checked_glb

from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document.puppet import PuppetLayer
from enliven.errors import InputError
from enliven.examples.baking.settings import BakeSettings
from enliven.examples.puppet_motion import convert_to_world_frame, evaluate_state
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import build_glb, write_gltf
from enliven.formats.gltf.read import read_gltf
from enliven.rotation import from_rotation_vector

PLACE, TURN = np.array([1.0, 0.0, -2.0]), from_rotation_vector(np.array([0.0, 0.7, 0.0]))


@pytest.fixture(scope="module")
def bean():
    """Returns a bean that moves through the world."""
    return made_puppets.project(layers=(PuppetLayer("dance"),), place=PLACE, turn=TURN)


def solved(project, times):
    """Returns (T, V, 3) the world positions from the surface's solver."""
    puppet = project.puppet("bean")
    surface = PuppetSurface(puppet.mesh, [p.vertex for p in puppet.points], settings=puppet.surface)
    out = []
    for number, time in enumerate(times):
        state = evaluate_state(project, puppet, time)
        moved = surface.solve(state.places) if number else surface.solve_from_rest(state.places)
        out.append(convert_to_world_frame(puppet, state, moved))
    return np.array(out)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["skin", "morphs"])
def test_a_file_plays_as_the_surface_is_solved_within_the_stated_error(bean, tmp_path, how):
    settings = BakeSettings(rms=0.001, worst=0.01, keys=0.0002)
    performance = sample_performance(bean, "bean", 0.3, 2.3, 20.0, how=how, settings=settings)
    assert (
        performance.error.rms <= 0.001 * performance.error.size
        and performance.error.worst <= 0.01 * performance.error.size
    )
    path = tmp_path / "bean.glb"
    write_gltf(path, [performance])
    checked_glb(path.read_bytes())
    expected = solved(bean, 0.3 + performance.times)
    slow, off = SlowGltf(path), []
    for frame, time in list(enumerate(performance.times))[::7]:
        shown = slow.vertices_at(0, float(np.float32(time)))
        off.append(np.linalg.norm(shown - expected[frame], axis=1))
    off = np.array(off)
    assert off.max() <= performance.error.worst + performance.keys + 1e-5
    assert np.sqrt((off**2).mean()) <= 1.5 * performance.error.rms + performance.keys
    assert np.linalg.norm(expected[0] - expected[-1], axis=1).max() > 50 * performance.error.rms


@pytest.mark.slow
def test_redundant_keys_are_left_out(bean):
    few = sample_performance(bean, "bean", rate=60.0, settings=BakeSettings(keys=0.002))
    all_of_them = sample_performance(bean, "bean", rate=60.0, settings=BakeSettings(keys=0.0))
    assert len(build_glb([few])) < 0.7 * len(build_glb([all_of_them]))


def test_a_puppet_that_plays_nothing_stands_at_rest():
    still = made_puppets.project(layers=())
    performance = sample_performance(still, "bean")
    assert performance.error.worst < 1e-6 and len(performance.times) == 1
    document = checked_glb(build_glb([performance]))
    assert "animations" not in document


def test_puppets_and_their_times_are_checked(bean):
    with pytest.raises(InputError, match="no character 'pea'"):
        sample_performance(bean, "pea")
    with pytest.raises(InputError, match="frames per second is not valid"):
        sample_performance(bean, "bean", 2.0, 1.0)
    unposed = bean.with_characters(bean.puppet("bean").with_changes(poses=()))
    with pytest.raises(InputError, match="Pose two examples"):
        sample_performance(unposed, "bean")


@pytest.mark.slow
def test_a_baked_puppet_is_read_again_though_its_joints_hang_free(bean, tmp_path):
    path = tmp_path / "bean.glb"
    write_gltf(path, [sample_performance(bean, "bean")])
    rig = read_gltf(path)
    mesh = bean.puppet("bean").mesh
    assert rig.shape.mesh is not None and len(rig.shape.mesh.vertices) == len(mesh.vertices)
    assert len(rig.shape.skeleton) > 3 and rig.notes, "bones only turn: it says what was lost"
