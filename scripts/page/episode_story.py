"""What `palpate episode` tells: probe by probe, and at the end."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform

    from ...envs.collision.collision import CollisionParts
    from ...envs.pictures.episode import Episode
    from ...envs.sensors.touch import Touch
    from ...recognizer import Belief, Polyhedron

__all__ = ["count", "probe_line", "stray_line", "verdict", "verdict_in_short"]

MOST_NAMED = 3
"""Rays of a probe whose outcomes are told one by one."""


def probe_line(number: int, touch: Touch, belief: Belief | None) -> str:
    """One line on what a probe met and what is left."""
    from ...envs.scene.scene import NOTHING, OBJECT, PLANE

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


def count(number: int, one: str, many: str = "") -> str:
    """A number and its noun."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def verdict(episode: Episode) -> str:
    """What was found, and how far it is from the truth."""
    import numpy as np

    from ...recognizer import pose_difference

    belief, truth = episode.belief, episode.T_world_object
    lines = [""]
    if belief is None:
        return f"\nNo probe touched the object ({episode.true_object.name})."
    if belief.empty:
        return "\nNo object of the library fits the contacts."
    best = belief.hypotheses[0]
    if belief.unique:
        lines.append(f"It is [bold]{best.object_name}[/].")
    else:
        lines.append(
            f"Not unique after {count(len(episode.touches), 'probe')}:"
            f" {count(len(belief.hypotheses), 'hypothesis', 'hypotheses')} left;"
            f" the heaviest is [bold]{best.object_name}[/] (weight {best.weight:.2f})."
        )
    lines.append(f"  pose   {_pose(best.pose)}")
    lines.append(f"  truth  {_pose(truth)}  {episode.true_object.name}")
    if best.object_name == episode.true_object.name:
        error = pose_difference(episode.true_object, best.pose, truth)
        lines.append(
            f"  error  {1e3 * error.translation:.2f} mm, {np.degrees(error.rotation):.2f}°"
            f" after {count(len(episode.touches), 'probe')} and"
            f" {count(len(episode.contacts), 'contact')}"
        )
    return "\n".join(lines)


def verdict_in_short(episode: Episode) -> tuple[str, str]:
    """The same as a title and a line below it."""
    import numpy as np

    from ...recognizer import pose_difference

    belief, truth = episode.belief, episode.true_object
    felt = f"{count(len(episode.touches), 'probe')}, {count(len(episode.contacts), 'contact')}"
    if belief is None:
        return "No probe touched the object", f"{felt}; it was {truth.name}"
    if belief.empty:
        return "No object of the library fits the contacts", f"{felt}; it was {truth.name}"
    best = belief.hypotheses[0]
    if not belief.unique:
        left = count(len(belief.hypotheses), "hypothesis", "hypotheses")
        return f"Not unique: {left} left", f"{felt}; the heaviest is {best.object_name}"
    if best.object_name != truth.name:
        return f"It is {best.object_name}", f"{felt}; in truth it was {truth.name}"
    error = pose_difference(truth, best.pose, episode.T_world_object)
    found = f"found to {1e3 * error.translation:.2g} mm and {np.degrees(error.rotation):.2g}°"
    return f"It is {best.object_name}", f"{felt}; {found}"


def stray_line(model: Polyhedron, parts: CollisionParts) -> str:
    """How far what is collided with strays from a mesh; empty where that is but rounding."""
    from ...envs.collision.parts_check import LEVELS

    # The least distance that is tried stands for rounding.
    if parts.stray <= LEVELS[0] * model.diameter:
        return ""
    return (
        f"{model.name} is touched as {count(len(parts.parts), 'convex part')} that"
        f" {'strays' if len(parts.parts) == 1 else 'stray'} from its mesh by up to"
        f" {1e6 * parts.stray:.2g} µm; the bounds on contacts include it."
    )


def _pose(pose: RigidTransform) -> str:
    import numpy as np

    x, y, z = 1e3 * pose.translation
    turn = np.degrees(pose.rotation.as_rotvec())
    return (
        f"({x:7.2f}, {y:7.2f}, {z:7.2f}) mm,"
        f" rotation vector ({turn[0]:7.2f}, {turn[1]:7.2f}, {turn[2]:7.2f})°"
    )
