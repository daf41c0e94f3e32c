"""What else is known may come in parts, or say nothing, and hides no stray contact."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.beliefs import holder
from helpers.scenes import KINDS, NAMES, probe
from helpers.sensing import L_BLOCK, SMALL
from helpers.two_ways import TIGHT, two_ways, ways
from oracles.solids import random_pose

from palpate.recognizer import Contacts, FreeSpace, Recognizer


@pytest.mark.parametrize("kind", ["free", "plane", "standing"])
@pytest.mark.parametrize("name", list(SMALL))
def test_knowledge_in_parts_leaves_the_same_as_all_at_once(name: str, kind: str) -> None:
    compared = 0
    for case in range(3):
        rng = np.random.default_rng([7, NAMES.index(name), list(KINDS).index(kind), case])
        scene = probe(name, rng, **KINDS[kind])
        contacts, paths = scene.contacts, scene.free_space
        cuts = sorted(rng.integers(len(contacts) // 2 + 1, len(contacts) + 1, 2))
        rows = [slice(0, cuts[0]), slice(cuts[0], cuts[1]), slice(cuts[1], None)]
        places = np.array_split(rng.permutation(len(paths)), len(rows))
        parts = [
            FreeSpace(
                paths.starts[row], paths.ends[row], radius=paths.radius[row], error=paths.error[row]
            )
            for row in places
        ]
        belief = scene.recognizer.recognize(
            contacts[rows[0]], free_space=parts[0], support=scene.support
        )
        for row, part in zip(rows[1:], parts[1:], strict=True):
            belief = scene.recognizer.update(belief, contacts[row], free_space=part)
        whole = scene.recognizer.recognize(
            contacts, free_space=FreeSpace.join(parts), support=scene.support
        )
        assert len(belief.contacts) == len(contacts)
        np.testing.assert_array_equal(belief.free_space.starts, whole.free_space.starts)
        assert belief.support is scene.support
        assert holder(belief, scene.faces) is not None
        if not (belief.complete and whole.complete):
            continue
        one, other = (
            {
                (h.object_name, *row)
                for h in each.hypotheses
                if h.proven
                for row in h.interpretations.tolist()
            }
            for each in (belief, whole)
        )
        every = [
            {(h.object_name, *row) for h in each.hypotheses for row in h.interpretations.tolist()}
            for each in (belief, whole)
        ]
        # What stays undecided may differ by where the work began; what has a witness may not.
        assert one <= every[1]
        assert other <= every[0]
        compared += int(every[0] == every[1])
    assert compared >= 2


def test_free_space_alone_can_follow_the_contacts() -> None:
    motion = random_pose(np.random.default_rng(8))
    recognizer = Recognizer([L_BLOCK])
    belief = recognizer.recognize(two_ways(motion))
    path = FreeSpace(
        motion.apply([[0.05, 0.04, -0.1]]), motion.apply([[0.05, 0.04, 0.1]]), error=5e-4
    )
    later = recognizer.update(belief, Contacts.none(), free_space=path)
    assert sorted(ways(belief, motion)) == [False, True]
    assert ways(later, motion) == [True]
    assert len(later.free_space) == 1
    assert ways(recognizer.update(later, Contacts.none()), motion) == [True]


def test_nothing_known_besides_changes_nothing() -> None:
    contacts = two_ways(random_pose(np.random.default_rng(9)))
    recognizer = Recognizer([L_BLOCK])
    one = recognizer.recognize(contacts)
    other = recognizer.recognize(contacts, free_space=FreeSpace.none())
    assert one.hypotheses
    for a, b in zip(one.hypotheses, other.hypotheses, strict=True):
        assert a.pose.as_matrix().tobytes() == b.pose.as_matrix().tobytes()
        assert a.weight == b.weight


def test_a_stray_contact_does_not_hide_behind_free_space() -> None:
    motion = random_pose(np.random.default_rng(10))
    good = two_ways(motion)
    stray = Contacts(motion.apply([[0.2, 0.2, 0.2]]), [[0.0, 0.0, 1.0]], **TIGHT)
    path = FreeSpace(
        motion.apply([[0.05, 0.04, -0.1]]), motion.apply([[0.05, 0.04, 0.1]]), error=5e-4
    )
    contacts = Contacts.join([good, stray])
    recognizer = Recognizer([L_BLOCK])
    assert recognizer.recognize(contacts, free_space=path).empty
    belief = recognizer.recognize(contacts, outliers=1, free_space=path)
    best = [h for h in belief.hypotheses if (h.interpretations == -1).sum(axis=1).min() == 1]
    assert best
    for hypothesis in best:
        assert (hypothesis.interpretations[:, -1] == -1).all()
        turn = (motion.rotation.inv() * hypothesis.pose.rotation).as_matrix()
        np.testing.assert_allclose(turn, np.eye(3), atol=0.1)
