"""What each constraint on pairs is worth, alone and with others (memo, Section 2.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

from ..report.markdown import Table
from .judge import COUNTS, Four, figure, four
from .plan import Plan, Trials, run_rows
from .section import Comparison, Figure, Section
from .trial import Spec, prepared

TRIALS = 100
GRID, TRIADS = "grid", "triads"
SETTINGS = (
    (Spec("housing", 10, 0.05), GRID),
    (Spec("stapler", 10, 0.05), GRID),
    (Spec("housing-34", 10, 0.05), TRIADS),
    (Spec("simple-hand", 10, 0.05), TRIADS),
)
SETS: Mapping[str, tuple[str, ...]] = {
    "distance": ("distance",),
    "angle": ("angle",),
    "direction": ("tilt",),
    "extended direction": ("component",),
    "distance + angle": ("distance", "angle"),
    "distance + direction": ("distance", "tilt"),
    "angle + direction": ("angle", "tilt"),
    "distance + ext. direction": ("distance", "component"),
    "angle + ext. direction": ("angle", "component"),
    "distance + angle + direction": ("distance", "angle", "tilt"),
    "distance + angle + ext. direction": ("distance", "angle", "component"),
    "all four": ("distance", "angle", "tilt", "component"),
}
ALONE = ("distance", "angle", "direction", "extended direction")
USED = "distance + angle + ext. direction"
"""What palpate prunes with."""
LIMIT = 100_000
"""Where counting stops: what is left then is at least that."""


@dataclass(frozen=True)
class ConstraintCounts:
    """What one trial's tree leaves with each of `SETS`."""

    left: tuple[int, ...]
    lost: int
    """Sets with which the right interpretation isn't among what is left, all of it counted."""
    checked: int
    """Sets with which all that is left was counted."""


def run(plan: Plan) -> Section:
    """Every set of constraints on the same contacts."""
    trials = plan.trials or TRIALS
    pieces = run_rows(plan, SETTINGS, trials, run_piece, "worth of constraints")
    found = {spec: [*chain.from_iterable(counts)] for (spec, _), counts in pieces.items()}
    fours = {
        spec: {name: four([trial.left[at] for trial in trials]) for at, name in enumerate(SETS)}
        for spec, trials in found.items()
    }
    everything = [trial for trials in found.values() for trial in trials]
    return Section(
        name="constraints",
        title="What each constraint is worth",
        place="Section 2.1; no table",
        asked=(
            "The memo says that the extended direction constraint does not make the distance"
            " constraint superfluous (Section 2.1.3), and calls the direction constraint's effect"
            " striking (4.1), but prints no table of what each does in space. What does each leave"
            " alone, and what together?"
        ),
        done=(
            f"The same contacts, {trials} trials an object, are pruned with each set of"
            " constraints: distance of two contacts; angle between their normals; direction, the"
            " angle between a normal and the line to the other contact (the memo's simple form);"
            " extended direction, how far the other contact lies above the one's face. Counting"
            f" stops at {LIMIT:,}."
        ),
        found=_found(fours),
        blocks=(
            _table(fours),
            (
                f"Cells are median / 90th percentile; {LIMIT:,} means that or more. The line that"
                " stands out is what palpate prunes with."
            ),
            _drawn(fours),
        ),
        comparisons=tuple(
            Comparison(
                (*spec.key, name), COUNTS, None, counts, "not judged", "the memo prints no figures"
            )
            for spec, sets in fours.items()
            for name, counts in sets.items()
        ),
        checked=sum(trial.checked for trial in everything),
        lost=sum(trial.lost for trial in everything),
    )


def run_piece(piece: Trials[tuple[Spec, str]]) -> list[ConstraintCounts]:
    """Some trials of a setting."""
    from ...envs.sensors.grid import sense_grid
    from ...recognizer.tree.tree import Constraints, prune
    from .triads import sense_triads

    (spec, sensing), counts = piece.row, []
    thing = prepared(spec.object_name)
    for rng in piece.generators():
        if sensing == GRID:
            truth = sense_grid(thing.model, rng)
        else:
            truth = sense_triads(spec.object_name, rng)
        contacts = truth.noisy(spec.noise(), rng)
        left, lost, checked = [], 0, 0
        for names in SETS.values():
            switches = {name: name in names for name in ("distance", "angle", "tilt", "component")}
            pruned = prune(
                thing.tables, contacts, constraints=Constraints(**switches), budget=LIMIT
            )
            left.append(len(pruned.faces))
            checked += pruned.complete
            lost += pruned.complete and not (pruned.faces == truth.faces).all(axis=1).any()
        counts.append(ConstraintCounts(tuple(left), int(lost), checked))
    return counts


def _found(fours: Mapping[Spec, Mapping[str, Four]]) -> str:
    """What the figures say of the memo's claim."""
    without_distance = [
        sets["angle + ext. direction"][1] / sets[USED][1] for sets in fours.values()
    ]
    without_direction = [sets["distance + angle"][1] / sets[USED][1] for sets in fours.values()]
    without_angle = [
        sets["distance + ext. direction"][1] / sets[USED][1] for sets in fours.values()
    ]
    simple = [sets["all four"][1] / sets[USED][1] for sets in fours.values()]
    strongest = {min(ALONE, key=lambda name: sets[name][1]) for sets in fours.values()}
    complement = ""
    if min(without_distance) > 1.0 and min(without_direction) > 1.0:
        complement = ": the two complement each other, as the memo says"
    return (
        f"The strongest alone: {' or '.join(sorted(strongest))}. Of the three that palpate uses,"
        f" leaving out the extended direction multiplies the median by {_span(without_direction)},"
        f" leaving out the angle by {_span(without_angle)}, leaving out the distance by"
        f" {_span(without_distance)}{complement}. With the simple direction constraint added, the"
        f" three leave {100 * min(simple):.0f} % to {100 * max(simple):.0f} % of what they leave"
        " without it."
    )


def _span(values: Sequence[float]) -> str:
    return f"{figure(round(min(values), 2))} to {figure(round(max(values), 2))}"


def _table(fours: Mapping[Spec, Mapping[str, Four]]) -> Table:
    heads = ["constraints"]
    for spec, sensing in SETTINGS:
        heads.append(f"{', '.join(spec.key)}, {sensing}")
    rows = [
        [name, *(f"{figure(sets[name][1])} / {figure(sets[name][2])}" for sets in fours.values())]
        for name in SETS
    ]
    return Table(heads, rows, marked=[list(SETS).index(USED)])


def _drawn(fours: Mapping[Spec, Mapping[str, Four]]) -> Figure:
    from .plots import draw_bars

    titled = {
        f"{spec.object_name}, {sensing}": [
            (name, counts[1], counts[2]) for name, counts in fours[spec].items()
        ]
        for spec, sensing in SETTINGS
    }
    return Figure(
        "constraints",
        draw_bars(titled, "interpretations", LIMIT),
        "Interpretations left by each set of constraints: medians, with a line to the 90th"
        " percentile; dotted, where counting stops.",
    )
