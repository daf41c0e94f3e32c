"""Sensors by name."""

from __future__ import annotations

from .ball_sensor import BallSensor
from .finger import FingerDesign
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
