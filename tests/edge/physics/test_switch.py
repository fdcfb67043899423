"""Tests that the physics of a running edge can be switched on and off, and that a missing engine is
reported.
"""

from __future__ import annotations

import importlib.util

import pytest
from patience import wait_until

from enliven.errors import ResourceError
from enliven.frames import BodyFrame
from enliven.wire import PhysicsMessage
from enliven_edge.physics.settings import PhysicsSettings
from enliven_edge.physics.switch import PhysicsSwitch
from enliven_edge.stage.tick import Tick


def tick(time_ns: int) -> Tick:
    return Tick(BodyFrame([], time_ns, "test"))


def test_boxes_come_and_go_while_the_edge_runs():
    pytest.importorskip("mujoco", reason="mujoco is not installed (the extra 'physics')")
    switch = PhysicsSwitch(PhysicsSettings(place="fixed"))
    assert (
        switch.take_changed_state() == PhysicsMessage("none", "off") and switch.take_changed_state() is None
    )
    switch.switch_to("boxes")
    assert (
        switch.take_changed_state() == PhysicsMessage("boxes", "preparing") and switch.step(tick(1)) is None
    )

    def is_on() -> bool:
        switch.show({})
        return switch.take_changed_state() == PhysicsMessage("boxes", "on")

    wait_until(is_on)
    props = switch.step(tick(2))
    assert props is not None and len(props.shapes) == 48
    switch.switch_to("none")
    empty = switch.step(tick(3))
    assert empty is not None and len(empty.shapes) == 0, "viewers remove the last boxes"
    assert switch.step(tick(4)) is None and switch.take_changed_state() == PhysicsMessage("none", "off")


def test_missing_physics_library_is_reported_with_the_install_command(monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "mujoco" else find(name))
    switch = PhysicsSwitch()
    with pytest.raises(ResourceError, match="mujoco"):
        switch.switch_to("dodgeball")
    state = switch.take_changed_state()
    assert state is not None and state.state == "missing"
    assert "mujoco" in state.what and "enliven-edge[physics]" in state.remedy
