"""`palpate episode`: one probing episode in simulation, told probe by probe, with a picture."""

from __future__ import annotations

import json as json_format
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from scipy.spatial.transform import RigidTransform

    from ..envs.probe_env import ProbeEnv
    from ..envs.touch import Touch
    from ..recognizer import Belief, Hypothesis

__all__ = ["episode"]

MOST_POSES = 4000
"""How many poses the JSON document lists of all families together, one a hypothesis at least."""
MOST_NAMED = 3
"""Rays of a probe whose outcomes are told one by one."""
MOST_GHOSTS = 2
"""More rivals than this in one picture hide each other."""


def episode(
    object_name: Annotated[
        str | None,
        typer.Option(
            "--object",
            metavar="NAME",
            help="The object to touch, from the library. [dim]default: drawn by the seed[/]",
            show_default=False,
        ),
    ] = None,
    library: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="A folder of closed meshes (OBJ, OFF, PLY or STL, metres) to tell apart. "
            "[dim]default: the library that comes with palpate[/]",
            show_default=False,
        ),
    ] = None,
    sensor: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="What touches: ray, ball, finger (a ball tip driven by dynamics), range (a"
            " scanner) or range-grid.",
        ),
    ] = "ray",
    placement: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="How the object lies: across the plane, resting on it, or dropped on it.",
        ),
    ] = "across",
    policy: Annotated[
        str, typer.Option(metavar="NAME", help="The strategy that chooses the probes.")
    ] = "random",
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="Same seed, same episode, to the bit.")
    ] = 45,
    picture: Annotated[
        Path,
        typer.Option(metavar="FILE", help="Where to draw the end of the episode, as a PNG."),
    ] = Path("episode.png"),
    no_picture: Annotated[bool, typer.Option("--no-picture", help="Draw nothing.")] = False,
    position_error: Annotated[
        float,
        typer.Option(
            metavar="M", help="A contact is felt within this distance of the truth, metres."
        ),
    ] = 0.000254,
    normal_error_deg: Annotated[
        float,
        typer.Option(metavar="A", help="A normal is felt within this angle of the truth, degrees."),
    ] = 18.0,
    max_probes: Annotated[
        int, typer.Option(metavar="N", min=1, help="Give up after this many probes.")
    ] = 40,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead of the story.")
    ] = False,
) -> None:
    """Touch an object in simulation until palpate knows which one it is and where it lies.

    Prints what could still be true after each probe, and draws the end as a picture.
    """
    import numpy as np
    from rich.console import Console

    from ..envs.picture import check_path
    from ..envs.probe_env import ProbeEnv
    from ..policies import make_policy

    chooser = make_policy(policy)
    if not no_picture:
        check_path(picture)
    env = ProbeEnv(
        library,
        object_name=object_name,
        placement=cast("Literal['across', 'resting', 'dropped']", placement),
        sensor=sensor,
        position_error=position_error,
        normal_error=float(np.radians(normal_error_deg)),
        max_probes=max_probes,
    )
    # The policy's stream is the seed's child: it never meets the environment's own.
    rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0])
    console = Console(highlight=False, quiet=json, soft_wrap=True)
    console.print(
        f"An unknown object, one of {len(env.library)},"
        f" {'lies across' if placement == 'across' else 'stands on'} a plane (seed {seed},"
        f" positions ±{1e3 * position_error:.3g} mm, normals ±{normal_error_deg:.3g}°)."
    )
    console.print(
        f"{'probe':<8}  {'its rays met':<20}  interpretations  hypotheses left", style="dim"
    )
    observation, _ = env.reset(seed=seed)
    ruled_out: list[tuple[Hypothesis, str]] = []
    ended = False
    while not ended:
        before = env.belief
        action = chooser.act(observation, rng)
        observation, _, terminated, truncated, _ = env.step(action)
        ended = terminated or truncated
        console.print(_told(len(env.touches), env.touches[-1], env.belief))
        if before and env.belief and before is not env.belief:
            ruled_out = _ruled_out(env, before, env.belief, len(env.touches)) + ruled_out
    if json:
        print(json_format.dumps(_document(env, seed), indent=2))
    else:
        console.print(_verdict(env))
    if not no_picture:
        _draw(env, ruled_out, picture, console)


def _told(number: int, touch: Touch, belief: Belief | None) -> str:
    """One line on what a probe met and what is left."""
    from ..envs.scene import NOTHING, OBJECT, PLANE

    names = {OBJECT: "object", PLANE: "plane", NOTHING: "nothing"}
    outcomes = [names[int(outcome)] for outcome in touch.outcomes]
    met = " ".join(f"{outcome:<6}" for outcome in outcomes)
    if len(outcomes) > MOST_NAMED:
        met = f"{', '.join(f'{many} {name}' for name, many in Counter(outcomes).items()):<20}"
    if belief is None:
        return f"probe {number:>2}  {met}  {'':>15}  nothing touched yet"
    per_object = Counter(hypothesis.object_name for hypothesis in belief.hypotheses)
    named = [f"{name} {count}" for name, count in per_object.most_common(3)]
    rivals = ", ".join(named + ["…"] * (len(per_object) > 3))
    left = len(belief.hypotheses)
    return (
        f"probe {number:>2}  {met}  {belief.interpretations:>15}"
        + (f"  {left}: {rivals}" if left else "  none: not in the library")
        + (", its pose still open" if left == 1 and not belief.hypotheses[0].determined else "")
        + ("" if belief.complete else "  (search cut short)")
    )


def _count(number: int, one: str, many: str = "") -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"


def _ruled_out(
    env: ProbeEnv, before: Belief, after: Belief, probe: int
) -> list[tuple[Hypothesis, str]]:
    """Hypotheses of one belief that no hypothesis of the next resembles, heaviest first."""
    from ..recognizer import pose_difference

    models = {model.name: model for model in env.library}
    tolerance = env.recognizer.tolerance
    gone = []
    for old in before.hypotheses:
        model = models[old.object_name]
        near = tolerance.distance(model.diameter, float(env.contacts.position_error.max()))
        differences = [
            pose_difference(model, old.pose, new.pose)
            for new in after.hypotheses
            if new.object_name == old.object_name
        ]
        if not any(
            d.rotation < 2 * tolerance.rotation and d.translation < 2 * near for d in differences
        ):
            gone.append((old, f"{old.object_name}, ruled out by probe {probe}"))
    return gone


def _verdict(env: ProbeEnv) -> str:
    """What was found, and how far it is from the truth."""
    import numpy as np

    from ..recognizer import pose_difference

    belief, truth = env.belief, env.T_world_object
    lines = [""]
    if belief is None:
        return f"\nNo probe touched the object ({env.true_object.name})."
    if belief.empty:
        return "\nNo object of the library fits the contacts."
    best = belief.hypotheses[0]
    if belief.unique:
        lines.append(f"It is [bold]{best.object_name}[/].")
    else:
        lines.append(
            f"Not unique after {_count(len(env.touches), 'probe')}:"
            f" {_count(len(belief.hypotheses), 'hypothesis', 'hypotheses')} left;"
            f" the heaviest is [bold]{best.object_name}[/] (weight {best.weight:.2f})."
        )
    lines.append(f"  pose   {_pose(best.pose)}")
    lines.append(f"  truth  {_pose(truth)}  {env.true_object.name}")
    if best.object_name == env.true_object.name:
        error = pose_difference(env.true_object, best.pose, truth)
        lines.append(
            f"  error  {1e3 * error.translation:.2f} mm, {np.degrees(error.rotation):.2f}°"
            f" after {_count(len(env.touches), 'probe')} and"
            f" {_count(len(env.contacts), 'contact')}"
        )
    return "\n".join(lines)


def _pose(pose: RigidTransform) -> str:
    import numpy as np

    x, y, z = 1e3 * pose.translation
    turn = np.degrees(pose.rotation.as_rotvec())
    return (
        f"({x:7.2f}, {y:7.2f}, {z:7.2f}) mm,"
        f" rotation vector ({turn[0]:7.2f}, {turn[1]:7.2f}, {turn[2]:7.2f})°"
    )


def _document(env: ProbeEnv, seed: int) -> dict[str, object]:
    """The episode as the --json document.

    A hypothesis whose pose is not fixed stands for a family of poses: it is listed once for each
    pose of a sample that spans it, its weight shared out, all under one ``family`` number.
    """
    belief = env.belief
    listed = []
    for number, hypothesis in enumerate(belief.hypotheses if belief else ()):
        share = max(1, MOST_POSES // len(belief.hypotheses)) if belief else 1
        poses = env.recognizer.sample_poses(hypothesis, env.contacts, share)
        listed += [
            {
                "object": hypothesis.object_name,
                "pose": pose.as_matrix().tolist(),
                "weight": hypothesis.weight / len(poses),
                "family": number,
                "determined": hypothesis.determined,
            }
            for pose in poses
        ]
    return {
        "truth": {
            "object": env.true_object.name,
            "pose": env.T_world_object.as_matrix().tolist(),
        },
        "hypotheses": listed,
        "unique": belief.unique if belief else False,
        "complete": belief.complete if belief else True,
        "probes": len(env.touches),
        "contacts": len(env.contacts),
        "seed": seed,
    }


def _draw(
    env: ProbeEnv, ruled_out: list[tuple[Hypothesis, str]], path: Path, console: Console
) -> None:
    from ..envs.episode_picture import episode_picture
    from ..envs.picture import draw, renderer_note

    belief = env.belief
    alive = belief.hypotheses[1:] if belief and not belief.unique else ()
    rivals = [(rival, f"{rival.object_name}, still possible") for rival in alive]
    summary = "recognised" if belief and belief.unique else "not unique yet"
    scene = episode_picture(
        env,
        (rivals + ruled_out)[:MOST_GHOSTS],
        title=f"{env.true_object.name}: {summary}",
        subtitle=f"{_count(len(env.touches), 'probe')},"
        f" {_count(len(env.contacts), 'contact')} on the object",
    )
    note = renderer_note(draw(scene, path))
    console.print(f"\npicture: {path}" + (f" ({note})" if note else ""))
