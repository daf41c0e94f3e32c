"""The memo's propositions on the size of the tree, beside what is counted (Section 6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...report.markdown import Table, items
from ..plan import Plan, run_rows
from ..section import Comparison, Figure, Section
from .counts import COUNTERS, LEVELS, NOISE, SHAPES, Shape, count_nodes, make_shape
from .plots import draw_nodes

Floats = NDArray[np.float64]

TRIALS = 100
"""The memo counted none; as many as in its simulations."""
SURE = 2.0
"""Standard errors by which a mean must be above a formula to count as above it."""
JUDGED = {
    "Proposition 1": "chain of middles",
    "corollary": "chain of ranges",
    "mended": "chain of ranges",
}
"""Formulas, and a chain that each should be above. For Proposition 1 it is the one of its proof."""
TREE = "all distances"
"""What the memo says that the formulas are above."""
BROKEN, BROKEN_CHAIN = "×", "(×)"


def run(plan: Plan) -> Section:
    """Count nodes on solids, stand-ins and outlines, beside the formulas."""
    trials = plan.trials or TRIALS
    found = run_rows(plan, SHAPES, trials, count_nodes, "nodes a level")
    nodes = {name: np.concatenate([one.nodes for one in found[name]]) for name in SHAPES}
    return _section(nodes, trials, sum(one.lost for pieces in found.values() for one in pieces))


def exceeds(counted: Floats, formula: Floats) -> NDArray[np.bool_]:
    """(LEVELS,) whether the mean of (t, LEVELS) counts is surely above a formula."""
    means = counted.mean(axis=0)
    spread = counted.std(axis=0, ddof=1) if len(counted) > 1 else np.full(LEVELS, np.inf)
    with np.errstate(invalid="ignore"):
        return means - SURE * spread / np.sqrt(len(counted)) > formula * (1.0 + 1e-9)


def _section(nodes: Mapping[str, Floats], trials: int, lost: int) -> Section:
    compared = tuple(
        comparison for name in SHAPES for comparison in compare(make_shape(name), nodes[name])
    )
    inches, degrees = NOISE.position_error / 0.0254, np.degrees(NOISE.normal_error)
    return Section(
        name="bounds",
        title="Section 6: how many interpretations to expect",
        place="Section 6, Propositions 1 to 3 and their corollaries",
        asked=(
            "How many interpretations of the first k contacts does the distance between contacts"
            " leave, out of the n to the power k that there are of an object of n faces? The memo"
            " gives formulas and calls them upper bounds on the number expected. Proposition 1:"
            " n (2 e n / d)^(k-1), where d is the object's diameter and e its sensitivity, how far"
            " the distance of two points may be from that of their faces' middles. Its corollaries"
            " put in what e is when all faces, or all edges of an outline, are alike."
        ),
        done=(
            f"{trials} times {LEVELS} contacts on each object were taken in random order"
            f" (solids: of a grid of rays; outlines: anywhere along them), positions within"
            f" {inches:.2f} in, normals within {degrees:.0f}°. Counted were, at each level: chains"
            " of faces whose middles are as far apart as two contacts in a row, give or take e,"
            " which is what the proof of Proposition 1 counts; chains of faces that have any points"
            " so far apart; the tree with all distances; and the tree with all constraints, as the"
            " recogniser has it. The objects: solids and outlines of equal faces or edges, which"
            " the corollaries are about, and the stand-ins."
        ),
        found=_found(nodes, compared),
        blocks=(
            Figure(
                "nodes",
                draw_nodes(nodes),
                "Mean number of interpretations against the level of the tree, on a logarithmic"
                " scale. Lines without marks are formulas, lines with marks were counted. A formula"
                " below what was counted is no bound.",
            ),
            _table(nodes),
            (
                f"Means over the trials. {BROKEN} marks a formula that the tree, pruned by all"
                f" distances, is above; {BROKEN_CHAIN} one that only the chain is above that its"
                f" proof is about; both by more than {SURE:g} standard errors. Mended is the"
                " corollary of Proposition 3 with the exponent that its own proof gives, (k+1)/2"
                " for (k-1)/2. The sphere has 320 faces; its trees were counted to level 3."
            ),
            items(_reasons()),
        ),
        comparisons=compared,
        checked=trials * len(SHAPES),
        lost=lost,
    )


def _reasons() -> list[str]:
    return [
        "Proposition 1 rests on sensed distances that are uniform up to the diameter and"
        " independent. Touches on a round object are mostly far apart, and so are its faces: more"
        " faces fit than the proof counts.",
        "Where e is more than half the diameter, Proposition 1 is above n to the power k, all"
        " interpretations there are, and says nothing. That holds for every solid here whose"
        " largest face reaches across it.",
        "The corollary of Proposition 3 is printed with an exponent that is too small by one, so it"
        " is too small by a factor of n.",
        "It also takes the area of a face to be at least that of a disc of the face's diameter. It"
        " is at most that: no figure of a diameter is larger than the disc. A square's diameter is"
        " 1.25 times what its area gives, a long face's many times. So the formula stays no bound"
        " with its exponent mended.",
        "The corollary of Proposition 2 wants equal edges; the planar stand-ins have long and short"
        " ones.",
    ]


def compare(shape: Shape, counted: Floats) -> list[Comparison]:
    """Proposition 1 and its corollary against the tree that distances prune.

    A formula is within if the tree's mean is surely above it at no level.

    Args:
        shape: the object.
        counted: (t, 4, LEVELS) as in `Counts.nodes`.
    """
    tree = counted[:, COUNTERS.index(TREE)]
    levels = [k for k in range(1, LEVELS) if not np.isnan(tree[:, k]).any()]
    formulas = shape.formulas()
    found = []
    for name in ("Proposition 1", "corollary"):
        formula = formulas[name]
        above = [k + 1 for k in levels if exceeds(tree, formula)[k]]
        worst = max((tree[:, k - 1].mean() / formula[k - 1] for k in above), default=0.0)
        # The corollary of a solid is that of Proposition 3, an outline's that of Proposition 2.
        flaws = ["its exponent, and the isodiametric inequality"] if "mended" in formulas else []
        flaws += [] if shape.equal else ["it wants equal faces or edges"]
        why = (
            f"the tree is up to {worst:.3g} times above it, at level {', '.join(map(str, above))}:"
            f" {'; '.join(flaws)}"
        )
        found.append(
            Comparison(
                key=(shape.model.name, name),
                names=tuple(f"level {k + 1}" for k in levels),
                memo=tuple(float(formula[k]) for k in levels),
                ours=tuple(float(tree[:, k].mean()) for k in levels),
                verdict="outside" if above else "within",
                why=why if above else "",
            )
        )
    return found


def _found(nodes: Mapping[str, Floats], compared: Sequence[Comparison]) -> str:
    broken = {
        name: [row.key[0] for row in compared if row.key[1] == name and row.verdict == "outside"]
        for name in ("Proposition 1", "corollary")
    }
    chains, mended, empty = [], [], []
    for name in SHAPES:
        shape, counted = make_shape(name), nodes[name]
        formulas = shape.formulas()
        if exceeds(counted[:, 0], formulas["Proposition 1"])[1:].any():
            chains.append(name)
        if "mended" in formulas:
            tree = counted[:, COUNTERS.index(TREE)]
            if exceeds(tree, formulas["mended"])[1:].any():
                mended.append(name)
        if (formulas["Proposition 1"] >= formulas["n^k"]).all():
            empty.append(name)
    first = (
        f"The tree is above Proposition 1 on {_listed(broken['Proposition 1'])}"
        if broken["Proposition 1"]
        else "The tree stays below Proposition 1 on every object"
    )
    share = _median_share(nodes)
    return (
        f"The corollaries as printed are no bounds: the tree is above them on"
        f" {_listed(broken['corollary'])}. The one for solids isn't one with its exponent mended"
        f" either: the tree is above it on {_listed(mended)}. {first}, though what its proof counts"
        f" is above it on {_listed(chains)}. It tells little: on {_listed(empty)} it is above the"
        " number of all interpretations. It looks at one distance a level, the tree at all of"
        f" them, and at angles and components too: at level {LEVELS} Proposition 1 has"
        f" {1.0 / share:,.0f} times as many as all constraints leave, in the median over the"
        " objects."
        " The memo says itself that its bounds are weak."
    )


def _median_share(nodes: Mapping[str, Floats]) -> float:
    shares = [
        nodes[name][:, 3, -1].mean() / make_shape(name).formulas()["Proposition 1"][-1]
        for name in SHAPES
        if not np.isnan(nodes[name][:, 3, -1]).any()
    ]
    return float(np.median(shares))


def _listed(names: Sequence[str]) -> str:
    if len(names) < 2:
        return names[0] if names else "none of them"
    return f"{', '.join(names[:-1])} and {names[-1]}"


def _table(nodes: Mapping[str, Floats]) -> Table:
    rows = []
    for name in SHAPES:
        shape, counted = make_shape(name), nodes[name]
        formulas = shape.formulas()
        means = counted.mean(axis=0)
        for k in range(1, LEVELS):
            cells = [f"{name}, {shape.model.face_count}", str(k + 1), _shown(formulas["n^k"][k])]
            for formula, chain in JUDGED.items():
                if formula not in formulas:
                    cells.append("")
                    continue
                mark = ""
                if exceeds(counted[:, COUNTERS.index(TREE)], formulas[formula])[k]:
                    mark = f" {BROKEN}"
                elif exceeds(counted[:, COUNTERS.index(chain)], formulas[formula])[k]:
                    mark = f" {BROKEN_CHAIN}"
                cells.append(_shown(formulas[formula][k]) + mark)
            rows.append([*cells, *map(_shown, means[:, k])])
    heads = ["object, faces or edges", "level k", "n^k", "Proposition 1", "corollary as printed"]
    return Table([*heads, "mended", *COUNTERS], rows)


def _shown(count: float) -> str:
    """A count to three digits; empty where there is none."""
    if np.isnan(count):
        return ""
    if 100.0 <= count < 1e5:
        return f"{count:,.0f}"
    digits, _, power = f"{count:.3g}".partition("e")
    return f"{digits}e{int(power)}" if power else digits
