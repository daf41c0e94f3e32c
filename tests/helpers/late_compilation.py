"""Prints the kernels that episodes and recognition compile after all warming up, one a line."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from helpers.command import run_here
from oracles.outlines import entry, feel
from oracles.solids import model, random_contacts, random_pose

from palpate.envs import warm_up as envs_parts
from palpate.policies import warm_up as policies_parts
from palpate.recognizer import Contacts, Polygon, Polyhedron, Recognizer
from palpate.recognizer import warm_up as recognizer_parts
from palpate.recognizer.compiling import Kernel
from palpate.recognizer.tree.tree import prune

EPISODES = (
    "",
    "--sensor ball --policy information",
    "--sensor range --policy pairs",
    "--placement dropped --policy decision-region",
    "--placement resting --sensor finger --free",
)


def compiled() -> set[str]:
    """Every kernel of the package with the types that it is compiled for."""
    return {
        f"{module.__name__}.{name}{signature}"
        for module in list(sys.modules.values())
        if module.__name__.startswith("palpate.") and module.__name__.endswith("_kernels")
        for name, value in vars(module).items()
        if isinstance(value, Kernel)
        for signature in value.signatures
    }


def play_episodes() -> None:
    for options in EPISODES:
        told = run_here("episode", "--no-picture", *options.split(), cwd=Path())
        assert told.code == 0, told.err


def recognize(shape: Polyhedron | Polygon, rng: np.random.Generator) -> None:
    recognizer = Recognizer([shape])
    for count in (1, 3, 9):
        contacts = touch(shape, count, rng)
        belief = recognizer.recognize(contacts)
        for hypothesis in belief.hypotheses[:3]:
            recognizer.sample_poses(hypothesis, contacts)
        recognizer.update(belief, contacts[:1])


def recognize_otherwise(solid: Polyhedron, rng: np.random.Generator) -> None:
    contacts = touch(solid, 3, rng)
    recognizer = Recognizer([solid], features="all")
    recognizer.recognize(contacts, outliers=1)
    recognizer.recognize(Contacts(contacts.positions, position_error=0.01 * solid.diameter))
    prune(recognizer.tables(solid.name), contacts)


def touch(shape: Polyhedron | Polygon, count: int, rng: np.random.Generator) -> Contacts:
    position_error, normal_error = 0.01 * shape.diameter, 0.2
    if isinstance(shape, Polygon):
        given = feel(shape, count, rng, position_error=position_error, normal_error=normal_error)
        return given.contacts
    pose = random_pose(rng, 1.0)
    return random_contacts(
        shape, pose, count, rng, position_error=position_error, normal_error=normal_error
    )[0]


if __name__ == "__main__":
    for module in (recognizer_parts, policies_parts, envs_parts):
        for part in module.PARTS:
            part()
    before = compiled()
    play_episodes()
    rng = np.random.default_rng(0)
    for shape in (model("housing"), entry("wrench").model):
        recognize(shape, rng)
    recognize_otherwise(model("tetrahedron"), rng)
    print(*sorted(compiled() - before), sep="\n")
