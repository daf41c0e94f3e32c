"""The finger: a ball tip on three slide joints, each with a position actuator of limited force."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

AXES = "xyz"
FINGER_GROUP = 4

SOFTNESS = 0.004
"""Time constant of contacts, seconds: a tip of 50 g sinks in by micrometres, not by tenths of a
millimetre as with MuJoCo's own 0.02."""

SHALLOWEST = 1e-9
"""Contacts less deep (metres) are none yet: MuJoCo takes the normal from the depth's two ends, and
where these are one it has none."""


@dataclass(frozen=True, kw_only=True)
class FingerDesign:
    """A finger's mechanics."""

    radius: float = 0.002
    """Of the ball tip, metres."""
    mass: float = 0.05
    """Of all that moves, kilograms."""
    stiffness: float = 2000.0
    """Of the position control along each axis, newtons a metre; it is critically damped."""
    force_limit: float = 5.0
    """The most that each axis pushes, newtons."""

    def __post_init__(self) -> None:
        for name in ("radius", "mass", "stiffness", "force_limit"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"the finger's {name} is {value:g}; it must be above zero")


def add_finger(spec: Any, design: FingerDesign) -> None:
    """Add a finger to a scene's specification; its joints read the tip's place in the world."""
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    body = spec.worldbody.add_body(name="finger", gravcomp=1.0)
    body.add_geom(
        name="tip",
        size=[design.radius, 0.0, 0.0],
        mass=design.mass,
        solref=[SOFTNESS, 1.0],
        priority=1,  # the tip's softness holds whatever it touches
        group=FINGER_GROUP,
    )
    for axis, along in zip(AXES, np.eye(3), strict=True):
        body.add_joint(name=axis, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=along)
        motor = spec.add_actuator(
            name=axis,
            target=axis,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            forcelimited=True,
            forcerange=[-design.force_limit, design.force_limit],
        )
        motor.set_to_position(kp=design.stiffness, dampratio=1.0)


@dataclass(frozen=True, eq=False)
class TipContact:
    """The tip on something, at one instant."""

    geom: int
    """What it touches."""
    centre_world: Floats
    """(3,) of the tip, metres."""
    normal_world: Floats
    """(3,) outward unit normal of what it touches."""
    depth: float
    """How deep the tip is inside, metres."""
    force: float
    """Along the normal, newtons."""


class Finger:
    """The finger of a compiled scene, at work."""

    def __init__(self, mj_model: mujoco.MjModel, mj_data: mujoco.MjData) -> None:
        """Find the finger in a scene that has one."""
        self._model, self._data = mj_model, mj_data
        joints = [mj_model.joint(axis) for axis in AXES]
        self._positions = slice(int(joints[0].qposadr[0]), int(joints[2].qposadr[0]) + 1)
        self._speeds = slice(int(joints[0].dofadr[0]), int(joints[2].dofadr[0]) + 1)
        first = mj_model.actuator(AXES[0]).id
        self._motors = slice(first, first + 3)
        self._tip = mj_model.geom("tip").id
        self.lag_time = float(
            -mj_model.actuator_biasprm[first, 2] / mj_model.actuator_gainprm[first, 0]
        )
        """How far behind its target the free tip moves, in seconds of its way."""
        self._wrench = np.zeros(6)

    @property
    def position(self) -> Floats:
        """(3,) where the tip's centre is, metres, world frame."""
        return self._data.qpos[self._positions].copy()

    def put(self, position: Floats, velocity: Floats) -> None:
        """Have the tip somewhere, moving, as if it had come all the way like this.

        Args:
            position: (3,) of its centre, metres, world frame.
            velocity: (3,) metres a second.
        """
        data = self._data
        data.qpos[self._positions] = position
        data.ctrl[self._motors] = position + self.lag_time * velocity
        data.qvel[self._speeds] = velocity
        # What the solver starts from must not depend on what was touched before.
        data.qacc_warmstart[self._speeds] = 0.0

    def step(self, target: Floats) -> None:
        """Go on by a time step, the actuators pulling towards ``target`` (3,), metres."""
        self._data.ctrl[self._motors] = target
        mujoco.mj_step(self._model, self._data)

    def contacts(self) -> Iterator[TipContact]:
        """What the tip touched at the start of the last step, and how hard."""
        data = self._data
        for index in range(data.ncon):
            contact = data.contact[index]
            one, other = contact.geom
            if self._tip not in (one, other) or contact.dist > -SHALLOWEST:
                continue
            mujoco.mj_contactForce(self._model, data, index, self._wrench)
            # MuJoCo's normal points from its first geom to its second.
            sign, geom = (1.0, one) if other == self._tip else (-1.0, other)
            yield TipContact(
                int(geom),
                data.geom_xpos[self._tip].copy(),
                sign * contact.frame[:3],
                -float(contact.dist),
                float(self._wrench[0]),
            )
