"""Measure the sensors: `python -m palpate.scripts.lab.bench.touch`.

Balls and fingers on their way to every face, convex edge and vertex of the stand-ins, against plain
geometry that knows no simulator; how long triads and steps take; and what it is worth to know that
an object rests on the plane. Each figure stands beside its goal, where it has one.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ...one_thread import keep_to_one_thread
from .__main__ import QUICK

if TYPE_CHECKING:
    from ....envs.sensors.ball_sensor import BallSensor
    from ....envs.sensors.finger_sensor import FingerSensor
    from ....recognizer import Polyhedron
    from .report import Row, Section

RADIUS = 0.002
POSITION_GOAL = {"ball": 1e-5, "finger": 5e-5}
"""Largest distance from where plain geometry puts a contact, metres."""
NORMAL_GOAL = 0.1
"""Largest angle of a normal on a face, degrees."""
KIND_GOAL = 0.999
"""Share of contacts whose feature is told right."""
NOTCH = 5e-4
"""A contact so deep inside the convex hull is in a notch, metres."""


class Part(StrEnum):
    """What can be measured on its own."""

    BALL = "ball"
    FINGER = "finger"
    SPEED = "speed"
    STEPS = "steps"
    PLACEMENT = "placement"


def bench_touch(
    approaches: Annotated[
        int, typer.Option(metavar="N", min=1, help="Random approaches a kind of feature.")
    ] = 1000,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the approaches.")] = 0,
    only: Annotated[
        list[Part] | None,
        typer.Option(metavar="PART", help=f"Only this part; one or more of: {', '.join(Part)}."),
    ] = None,
    steps: Annotated[int, typer.Option(metavar="N", min=10, help="Steps that are timed.")] = 1000,
    episodes: Annotated[
        int, typer.Option(metavar="N", min=3, help="Episodes an object, of each placement.")
    ] = 40,
    robotics_python: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="A Python that has gymnasium-robotics, to compare steps with; by default this.",
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A tenth of approaches, steps and episodes.")
    ] = False,
) -> None:
    """Measure how exactly balls and fingers touch, and how long triads and steps take.

    ball, finger: approaches to each kind of feature of each stand-in, every feature in its turn,
    against plain geometry. speed: median time of a triad at random places around each stand-in.
    steps: steps a second of the environment, with the recogniser and without, and of another
    environment of touch. placement: how many probes fewer an object needs that rests on the plane.
    """
    keep_to_one_thread()
    # Only now: what these import reads the number of threads once.
    from .placement import measure_placement
    from .report import show
    from .touch_speed import measure_steps, measure_triads

    share = QUICK if quick else 1
    print(f"seed {seed}, one thread, processor time")
    for part in only or list(Part):
        if part == Part.SPEED:
            show(measure_triads(seed))
        elif part == Part.STEPS:
            show(measure_steps(max(steps // share, 10), seed, robotics_python))
        elif part == Part.PLACEMENT:
            for section in measure_placement(max(episodes // share, 3), seed):
                show(section)
        else:
            show(measure_touch(part, max(approaches // share, 1), seed))


def measure_touch(name: str, approaches: int, seed: int) -> Section:
    """How far a sensor's contacts are from where plain geometry has them."""
    from ....envs.library import load_library
    from .report import Section
    from .touch_cases import KINDS

    rows = [
        _touch_row(name, model, kind, approaches, seed)
        for model in load_library()
        for kind in KINDS
    ]
    return Section(
        f"{name}, tip of {1e3 * RADIUS:g} mm: largest error of position, before noise",
        rows,
        f"{approaches} approaches a kind of feature. Place and normal are even over a feature,"
        " orientations over all that face the ball within 84 degrees. Goals are for the largest"
        " error of all approaches; on edges and vertices the normal has none. A contact is in a"
        " notch if it is half a millimetre or more inside the convex hull.",
    )


def _touch_row(name: str, model: Polyhedron, kind: int, approaches: int, seed: int) -> Row:
    import numpy as np

    from ....envs.scene.scene import OBJECT, ProbeScene
    from .report import Row, steps
    from .touch_cases import FACE, KINDS, ApproachSampler, depth_in_hull

    rng = np.random.default_rng([seed, kind, *model.name.encode()])
    sensor = _sensor(name, model)
    sampler = ApproachSampler(model, RADIUS, sensor.reach)
    scene = ProbeScene(model)
    apart, turned, right, notched, reached = [], [], [], 0, set()
    what = f"{model.name}, {KINDS[kind]}"
    for index in steps(range(approaches), f"{name}: {what}"):
        approach = sampler.draw(kind, index % sampler.count(kind), rng)
        if approach is None:
            continue
        swept = approach.swept
        scene.place(approach.T_world_object)
        (felt,) = sensor.feel(scene, approach.start_world[None], approach.direction_world[None])
        apart.append(float(np.linalg.norm(felt.position_world - swept.position_world)))
        away = float(np.linalg.norm(felt.normal_world - swept.normal_world))
        turned.append(float(np.degrees(2.0 * np.arcsin(min(away / 2.0, 1.0)))))
        right.append(felt.outcome == OBJECT and felt.kind == kind)
        contact = approach.T_world_object.inv().apply(swept.position_world)
        notched += depth_in_hull(model, contact) > NOTCH
        reached.add(approach.feature)
    if not apart:
        return Row(what, "none reached", "", False)
    goal = POSITION_GOAL[name]
    met = max(apart) <= goal and float(np.mean(right)) >= KIND_GOAL
    if kind == FACE:
        met = met and max(turned) <= NORMAL_GOAL
    return Row(
        what,
        f"{1e6 * max(apart):.3f} µm",
        f"{1e6 * goal:g} µm",
        met,
        [
            f"median {1e6 * np.median(apart):.3f} µm; normal within {max(turned):.2g}°; kind right"
            f" in {np.mean(right):.2%} of {len(apart)}; {len(reached)} of {sampler.count(kind)}"
            f" reached; {notched} in notches"
        ],
    )


def _sensor(name: str, model: Polyhedron) -> BallSensor | FingerSensor:
    import numpy as np

    from ....envs.probe_env import INCH, REACH
    from ....envs.scene.finger import FingerDesign
    from ....envs.sensors.ball_sensor import BallSensor
    from ....envs.sensors.finger_sensor import FingerSensor
    from ....envs.sensors.noise import SensorNoise

    noise = SensorNoise(position_error=0.01 * INCH, normal_error=np.pi / 10.0)
    reach = REACH * model.diameter
    if name == "ball":
        return BallSensor(noise, reach, RADIUS)
    return FingerSensor(noise, reach, FingerDesign(radius=RADIUS))


if __name__ == "__main__":
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(bench_touch)
    app()
