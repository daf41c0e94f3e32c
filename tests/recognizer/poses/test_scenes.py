"""Free space, support and approaches: with all inside its bounds, the truth is never lost."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from helpers.beliefs import holder
from helpers.scenes import KINDS, NAMES, Scene, probe, recognizer_of, settle_down
from helpers.sensing import SMALL, feel, touch_faces
from oracles.checker import broken


def judged(scene: Scene, rng: np.random.Generator, checked: int = 3) -> tuple[list[str], Counter]:
    """What is wrong with the belief in a scene; and counts of what there was to get wrong."""
    model = scene.model
    features = scene.recognizer.features(model.name)
    given = {"free_space": scene.free_space, "support": scene.support}
    # The scene itself is within all bounds, or it would prove nothing.
    wrong = broken(model, scene.pose, scene.contacts, scene.faces, features=features, **given)
    wrong = [f"the scene breaks {what}" for what in wrong]
    belief = scene.recognizer.recognize(scene.contacts, **given)
    if belief.complete and holder(belief, scene.faces) is None:
        wrong.append("the truth was lost")
    proven = [hypothesis for hypothesis in belief.hypotheses if hypothesis.proven]
    for row in rng.permutation(len(proven))[:checked]:
        pose, faces = proven[row].pose, proven[row].interpretations[0]
        lacks = broken(model, pose, scene.contacts, faces, features=features, **given)
        wrong += [f"a proven pose breaks {what}" for what in lacks]
    counts = Counter(
        scenes=1,
        complete=int(belief.complete),
        hypotheses=len(belief.hypotheses),
        proven=len(proven),
    )
    return wrong, counts


every_kind = pytest.mark.parametrize("kind", KINDS)
every_name = pytest.mark.parametrize("name", NAMES)


def scene_campaign(name: str, kind: str, seed: int, cases: int) -> tuple[list[str], Counter]:
    wrong, counts = [], Counter()
    for case in range(cases):
        rng = np.random.default_rng([seed, NAMES.index(name), list(KINDS).index(kind), case])
        lacks, more = judged(probe(name, rng, **KINDS[kind]), rng)
        wrong += [f"case {case}: {what}" for what in lacks]
        counts += more
    return wrong, counts


QUICK = {
    "cube": {"free": 40, "plane": 30, "standing": 15, "edges": 1, "vague": 1},
    "L-block": {"free": 12, "plane": 10, "standing": 25, "edges": 0, "vague": 1},
    "holed": {"free": 20, "plane": 8, "standing": 12, "edges": 0, "vague": 1},
    "housing": {"free": 2, "plane": 0, "standing": 1, "edges": 0, "vague": 0},
}
"""Scenes of the quick run: twenty seconds or so in all."""


@pytest.mark.parametrize(
    ("name", "kind", "cases"),
    [(name, kind, cases) for name in QUICK for kind, cases in QUICK[name].items() if cases],
)
def test_the_truth_is_never_lost_and_what_is_proven_breaks_nothing(
    name: str, kind: str, cases: int
) -> None:
    wrong, counts = scene_campaign(name, kind, seed=1, cases=cases)
    assert wrong == []
    assert counts["complete"] == counts["scenes"] == cases
    assert counts["proven"] > 0.5 * cases or cases < 5


@pytest.mark.slow
@every_kind
@every_name
def test_the_truth_is_never_lost_in_a_long_campaign(name: str, kind: str) -> None:
    cases = {"edges": 15, "vague": 40}.get(kind, 300)
    wrong, _ = scene_campaign(name, kind, seed=2, cases=cases if name in SMALL else cases // 3)
    assert wrong == []


def test_the_truth_stands_on_a_plane_known_so_badly_that_it_says_little() -> None:
    model = SMALL["L-block"]
    recognizer = recognizer_of("L-block")
    for case in range(10):
        rng = np.random.default_rng([11, case])
        pose, support = settle_down(model, rng, True, 0.25 * model.diameter, case % 3 == 0)
        touches = touch_faces(model, rng, rng.integers(model.face_count, size=5).tolist(), pose)
        contacts = feel(touches, rng, 2e-4, 0.1, at_bounds=case % 3 == 0)
        belief = recognizer.recognize(contacts, support=support)
        assert holder(belief, touches.faces) is not None
