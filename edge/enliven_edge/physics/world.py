"""Rigid boxes and balls on a floor, and kinematic spheres among them, simulated by MuJoCo."""

from __future__ import annotations

import logging
import math
import time
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from enliven.arrays import Float, Int, UInt8
from enliven.document import BALL
from enliven_edge.physics.contacts import FLOOR, NOTHING, correct_contacts, limit_speeds
from enliven_edge.physics.settings import EngineSettings

log = logging.getLogger(__name__)

_MAX_CATCH_UP_S = 0.1
"""Maximum time in seconds that is simulated after a pause. The rest of the pause is skipped."""
MAX_SUBSTEP_S = 0.0056
"""Maximum time step of the simulation in seconds. Smaller steps are more stable but slower."""
_MAX_SPHERE_SPEED_M_S = 15.0
"""Maximum speed of a character's sphere in metres per second. A faster sphere counts as a jump and hits
nothing."""
_MAX_PUSH_OUT_M_S = 0.8
"""Maximum speed in metres per second at which overlapping objects are pushed apart."""
MAX_PROP_SPEED_M_S = 12.0
"""Maximum speed of boxes and balls in metres per second."""
CONTACT_TIME_S = 0.02
"""Time constant in seconds in which contacts settle. Lower values make contacts harder."""
# Handle the engine's warnings here. Otherwise the engine writes a file MUJOCO_LOG.TXT into the working
# directory.
mujoco.set_mju_user_warning(lambda message: log.debug("warning of the physics engine: %s", message))

_PROP = 1
"""Collision bit of props, which collide with everything."""
_SPHERE = 2
"""Collision bit of spheres, which collide with props only."""
_FLOOR = 4
"""Collision bit of the floor, which collides with props only."""
_PARKING_PLACE = np.array([0.0, -60.0, 0.0])
"""(3,) position of unused spheres in metres, far below the floor."""
_SPHERE_BATCH = 64
"""Number of spheres that are added to the model at once. They are added in batches, because rebuilding the
model takes time."""
_MAX_TURN_RATE = 40.0
"""Maximum angular speed of a prop in radians per second. A faster rotation is a contact error."""
_MAX_PROP_DISTANCE_M = 500.0
"""Maximum distance of a prop from the origin in metres. Only an error flings a prop farther away."""


@dataclass(frozen=True)
class PropSpecs:
    """The fixed properties of the props.

    Attributes:
        shapes: (P,) uint8, BOX or BALL.
        sizes: (P, 3) metres: half edges of a box; for a ball the radius, three times.
        masses: (P,) kilograms.
        colours: (P, 3) uint8 sRGB.
        bounce: (P,) restitution: speed after a bounce divided by the speed before.
    """

    shapes: UInt8
    sizes: Float
    masses: Float
    colours: UInt8
    bounce: Float


class World:
    """The simulation state of the props. :meth:`move` places the spheres, :meth:`advance` advances time.

    Attributes:
        touched: (P,) contact of each prop in the last :meth:`advance`: a sphere's index, FLOOR or NOTHING.
        left_out: total seconds that were skipped because of the time budget.
    """

    def __init__(self, props: PropSpecs, settings: EngineSettings | None = None) -> None:
        self.props, self.settings = props, settings or EngineSettings()
        self.touched = np.full(len(props.shapes), NOTHING)
        self.left_out = 0.0
        self._from = self._to = np.zeros((0, 3))
        self._radii = np.zeros(0)
        self._build(0)

    @property
    def positions(self) -> Float:
        """Returns the (P, 3) positions of the props in metres."""
        return self._data.qpos.reshape(-1, 7)[:, :3]

    @property
    def turns(self) -> Float:
        """Returns the (P, 4) unit quaternions world_from_prop."""
        return self._data.qpos.reshape(-1, 7)[:, 3:]

    @property
    def velocities(self) -> Float:
        """Returns the (P, 6) linear and angular velocities of the props.

        Linear velocities are in metres per second. Angular ones are in radians per second in the prop's own
        frame.
        """
        return self._data.qvel.reshape(-1, 6)

    def set_state(
        self, which: Int | slice, positions: Float, turns: Float | None = None, speeds: Any = 0.0
    ) -> None:
        """Sets positions, rotations and speeds of props.

        Args:
            positions: (K, 3) metres.
            turns: (K, 4) quaternions; None for upright props.
            speeds: (K, 3) metres per second.
        """
        self.positions[which] = positions
        self.turns[which] = (1.0, 0.0, 0.0, 0.0) if turns is None else turns
        self.velocities[which] = 0.0
        self.velocities[which, :3] = speeds
        self._data.qacc_warmstart[:] = 0.0

    def move(self, centres: Float, radii: Float) -> None:
        """Sets the spheres' positions at the end of the next :meth:`advance`.

        Args:
            centres: (S, 3) metres. A row that is not finite removes its sphere.
            radii: (S,) metres.
        """
        is_present = np.isfinite(centres).all(1) & np.isfinite(radii) & (radii > 0)
        if len(centres) > len(self._to):
            self._build(len(centres))
        was_present, count = self._radii, len(centres)
        target = np.tile(_PARKING_PLACE, (len(self._to), 1))
        target[:count][is_present] = centres[is_present]
        self._radii = np.zeros(len(self._to))
        self._radii[:count][is_present] = radii[is_present]
        self._from, self._to = self._to.copy(), target
        # A sphere that has just appeared has no previous position, so it gets no velocity.
        is_new = (was_present == 0) != (self._radii == 0)
        self._from[is_new] = self._to[is_new]
        self._resize(np.flatnonzero(np.abs(self._radii - was_present) > 1e-3 * was_present))

    def restart(self) -> None:
        """Stops every motion after an error."""
        mujoco.mj_resetData(self._model, self._data)
        self._from = self._to
        self._data.mocap_pos[:] = self._to

    def mark_as_new(self, numbers: slice) -> None:
        """Marks spheres as new, so that they get no velocity from a previous position."""
        self._from[numbers] = self._to[numbers]

    def advance(self, seconds: float) -> str:
        """Simulates the given time. Returns an error text if the props are no longer valid, else ""."""
        self.touched[:] = NOTHING
        total_s, settings = min(max(seconds, 0.0), _MAX_CATCH_UP_S), self.settings
        count = math.ceil(total_s / MAX_SUBSTEP_S - 1e-6)
        if count <= 0:
            self._data.mocap_pos[:] = self._to
            return ""
        step = self._model.opt.timestep = total_s / count
        path = self._to - self._from
        path[np.square(path).sum(1) > (_MAX_SPHERE_SPEED_M_S * max(seconds, total_s)) ** 2] = 0.0
        speeds = path / max(seconds, total_s)
        started_at = time.perf_counter()
        for k in range(count):
            # After a long pause, simulate only the end of the pause.
            self._data.mocap_pos[:] = self._to - speeds * (total_s - k * step)
            problem = self._substep(speeds)
            if problem:
                return problem
            if settings.budget and time.perf_counter() - started_at > settings.budget and k + 1 < count:
                self.left_out += total_s - (k + 1) * step
                break
        self._data.mocap_pos[:] = self._to
        max_distance = np.abs(self.positions).max(initial=0.0)
        return "" if max_distance < _MAX_PROP_DISTANCE_M else "an object was thrown too far away"

    def _substep(self, speeds: Float) -> str:
        """Runs one step of the engine. Returns an error text, or ""."""
        model, data = self._model, self._data
        try:
            mujoco.mj_step1(model, data)
            contact = data.contact
            # Copy MuJoCo's arrays. They are strided if there are several contacts, and the kernel needs one
            # memory layout.
            columns = contact.geom, contact.frame, contact.dist, contact.efc_address, contact.dim
            correct_contacts(
                *map(np.ascontiguousarray, columns),
                data.efc_aref,
                data.efc_KBIP,
                data.efc_vel,
                self._owner,
                speeds,
                self.props.bounce,
                _MAX_PUSH_OUT_M_S,
                model.opt.timestep,
                self.touched,
            )
            mujoco.mj_step2(model, data)
        except mujoco.FatalError as error:
            return f"the engine failed ({error})"
        if not limit_speeds(self.velocities, MAX_PROP_SPEED_M_S, _MAX_TURN_RATE):
            return "a velocity is not a finite number"
        return "" if np.isfinite(data.qpos).all() else "a position is not a finite number"

    def _build(self, spheres: int) -> None:
        """Builds the engine's model for at least ``spheres`` spheres. Moving props keep their motion."""
        count = -(-spheres // _SPHERE_BATCH) * _SPHERE_BATCH
        old_data = getattr(self, "_data", None)
        self._model = _engine_model(self.props, count, self.settings)
        self._data = mujoco.MjData(self._model)
        if old_data is not None:
            self._data.qpos[:], self._data.qvel[:] = old_data.qpos, old_data.qvel
        kept_count = len(self._to)
        self._from, self._to = (_pad_rows(a, count, _PARKING_PLACE) for a in (self._from, self._to))
        self._radii = np.concatenate([self._radii, np.zeros(count - kept_count)])
        self._geoms = np.array([self._model.geom(f"sphere{k}").id for k in range(count)], np.int64)
        self._owner = np.full(self._model.ngeom, FLOOR, np.int64)
        self._owner[self._geoms] = np.arange(count)
        for p in range(len(self.props.shapes)):
            self._owner[self._model.geom(f"prop{p}").id] = -3 - p
        self._resize(np.arange(count))
        self._data.mocap_pos[:] = self._to

    def _resize(self, numbers: Int) -> None:
        """Sets the radii of spheres. A sphere of radius 0 collides with nothing."""
        if not len(numbers):
            return
        model, geoms, radii = self._model, self._geoms[numbers], self._radii[numbers]
        model.geom_size[geoms, 0] = model.geom_rbound[geoms] = np.maximum(radii, 1e-3)
        model.geom_aabb[geoms, 3:] = np.maximum(radii, 1e-3)[:, None]
        bits = np.where(radii > 0, _SPHERE, 0)
        bodies = model.geom_bodyid[geoms]
        model.geom_contype[geoms] = model.body_contype[bodies] = bits
        meets = np.where(radii > 0, _PROP, 0)
        model.geom_conaffinity[geoms] = model.body_conaffinity[bodies] = meets


def _pad_rows(rows: Float, count: int, fill: Float) -> Float:
    """Returns the rows (count, 3), padded with ``fill``."""
    return np.concatenate([rows, np.tile(fill, (count - len(rows), 1))])


def _engine_model(props: PropSpecs, spheres: int, settings: EngineSettings) -> Any:
    """Returns the engine's model: a floor, the props and the spheres."""
    spec = mujoco.MjSpec()
    option = spec.option
    option.gravity = [0.0, -settings.gravity, 0.0]
    option.timestep = MAX_SUBSTEP_S
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    # Five iterations are enough. Resting contacts need three, because with two a tower bursts. More than five
    # slow a crash down without visible gain.
    option.iterations = 5
    common: dict[str, Any] = {
        "solref": [CONTACT_TIME_S, 1.0],
        "friction": [settings.friction, 0.005, 0.0005],
    }
    floor = {"contype": _FLOOR, "conaffinity": _PROP, **common}
    # Rotate the plane, because the engine's planes face +Z.
    floor_rotation = [math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0]
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], quat=floor_rotation, **floor)
    everything = _PROP | _SPHERE | _FLOOR
    for p in range(len(props.shapes)):
        body = spec.worldbody.add_body()
        body.add_freejoint()
        ball = int(props.shapes[p]) == BALL
        kind = mujoco.mjtGeom.mjGEOM_SPHERE if ball else mujoco.mjtGeom.mjGEOM_BOX
        prop_contact = {"contype": _PROP, "conaffinity": everything, **common}
        if ball:
            # Contacts include rolling friction, so that a rolling ball stops.
            prop_contact["condim"] = 6
        body.add_geom(
            name=f"prop{p}", type=kind, size=list(props.sizes[p]), mass=float(props.masses[p]), **prop_contact
        )
    for k in range(spheres):
        body = spec.worldbody.add_body(mocap=True, pos=list(_PARKING_PLACE))
        sphere_contact = {"contype": _SPHERE, "conaffinity": _PROP, **common}
        body.add_geom(
            name=f"sphere{k}", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.01, 0, 0], **sphere_contact
        )
    return spec.compile()
