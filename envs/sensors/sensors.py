"""Sensors by name."""

from __future__ import annotations

from collections.abc import Sequence

from ..scene.finger import FingerDesign
from .ball_sensor import BallSensor
from .finger_sensor import FingerSensor
from .noise import SensorNoise
from .range_grid import RangeGrid
from .range_sensor import RangeScanner
from .ray_sensor import RaySensor
from .touch import Sensor

SENSOR_NAMES = ("ray", "ball", "finger", "range", "range-grid")
WIDTH = 0.75
"""Side of the square that a range sensor looks at, as a share of its reach."""


def make_sensor(
    name: str,
    noise: SensorNoise,
    reach: float,
    *,
    radius: float | None = None,
    speed: float | None = None,
    force_threshold: float | None = None,
) -> Sensor:
    """The sensor of a name; what isn't given is the sensor's own default.

    Args:
        name: one of `SENSOR_NAMES`; "range" is a scanner, "range-grid" has a grid an axis.
        noise: bounds on what it reports.
        reach: how far before the point that a probe is sent to its rays start, metres.
        radius: of a ball or a finger's tip, metres.
        speed: of a finger, metres a second.
        force_threshold: at which a finger stops, newtons.

    Raises:
        ValueError: an unknown name, an option that the sensor doesn't have, or a value that it
            doesn't take.
    """
    options = {"radius": radius, "speed": speed, "force_threshold": force_threshold}
    given = {option: value for option, value in options.items() if value is not None}
    known = {"ball": ("radius",), "finger": tuple(options)}
    if name not in SENSOR_NAMES:
        raise ValueError(f"no sensor is called {name!r}; there are: {', '.join(SENSOR_NAMES)}")
    for option in given:
        if option not in known.get(name, ()):
            raise ValueError(f"the sensor {name!r} has no {option}")
    if name == "ray":
        return RaySensor(noise, reach)
    if name == "range":
        return RangeScanner(noise, width=WIDTH * reach, reach=reach)
    if name == "range-grid":
        return RangeGrid(noise, width=WIDTH * reach, reach=reach)
    if name == "ball":
        return BallSensor(noise, reach, **given)
    design = FingerDesign(radius=given.pop("radius")) if "radius" in given else FingerDesign()
    return FingerSensor(noise, reach, design, **given)


def make_sensors(
    named: str | Sensor | Sequence[str | Sensor],
    noise: SensorNoise,
    reach: float,
    *,
    radius: float | None = None,
    force_threshold: float | None = None,
) -> tuple[Sensor, ...]:
    """The sensors of an episode: each by name, or ready.

    Args:
        named: one or several.
        noise: bounds on what those made here report.
        reach: of those made here, see `make_sensor`.
        radius: of the balls and finger tips among them, metres.
        force_threshold: at which the fingers among them stop, newtons.

    Raises:
        ValueError: as `make_sensor`; no sensor at all, or an option that none of them has.
    """
    wanted = [named] if isinstance(named, str) or not isinstance(named, Sequence) else list(named)
    if not wanted:
        raise ValueError("there is no sensor: name at least one of " + ", ".join(SENSOR_NAMES))
    names = [one for one in wanted if isinstance(one, str)]
    for option, value, takers in (
        ("radius", radius, ("ball", "finger")),
        ("force_threshold", force_threshold, ("finger",)),
    ):
        if value is not None and not set(takers) & set(names):
            if not names:
                raise ValueError(f"{option} is {value:g}, but a ready sensor has its own")
            raise ValueError(f"the sensor {', '.join(names)!r} has no {option}")
    return tuple(
        make_sensor(
            one,
            noise,
            reach,
            radius=radius if one in ("ball", "finger") else None,
            force_threshold=force_threshold if one == "finger" else None,
        )
        if isinstance(one, str)
        else one
        for one in wanted
    )
