"""What a report says: results as tables, figures and the words around them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ..benchmark.row import EpisodeRow
from .markdown import Table, items, literal
from .results import BASELINES, PolicyResult, SettingResult
from .statistics import Estimate

TITLE = "Where to touch next: strategies compared"
HITS = "random-hit"
UNINFORMED = (*BASELINES, "grid")
"""Strategies that don't ask what a probe would tell."""
SIGNIFICANT = 0.05
GOALS = {
    "both": "which object it is and how it lies",
    "pose": "how it lies",
    "object": "which object it is",
}


def introduction(rows: Sequence[EpisodeRow]) -> Iterator[str]:
    """What was played, for someone who hasn't seen it."""
    one = rows[0]
    yield f"# {TITLE}"
    yield (
        "An unknown object lies in an unknown pose on or across a plane. Each probe sends"
        " rays down at it; every ray reports where it met the object and the direction of the"
        " surface there, both within known bounds, or that it met the plane. After each probe a"
        " recogniser lists every hypothesis (object and pose) that all contacts so far allow,"
        " and a strategy chooses the next probe. An episode is solved when the recogniser knows"
        f" {GOALS[one.goal]}; after {one.max_probes} probes it is given up."
    )
    yield (
        "All strategies play the same episodes: the same object in the same pose, the same"
        " first probe, the same noise. So they are compared episode by episode. Fewer probes"
        f" are better; an episode that was given up counts as {one.max_probes + 1}."
    )
    yield items(
        [
            f"objects: {_listed(row.objects for row in rows)}"
            " (library: any of the objects that come with palpate, not known which);",
            f"bounds on normals and positions: {_listed(row.noise for row in rows)};",
            f"sensor: {one.sensor}; placement: {one.placement}; first probe: the seed's;",
            f"strategies: {_listed(row.policy for row in rows)};",
            f"episodes: seeds {min(r.seed for r in rows)} to {max(r.seed for r in rows)}.",
        ]
    )


def at_a_glance(results: Sequence[SettingResult]) -> Iterator[str]:
    """The best strategy of each setting."""
    baselines = [name for name in BASELINES if any(_named(r, name) for r in results)]
    heads = ["objects", "noise", "best strategy", "its probes", "floor"]
    for name in baselines:
        heads += [f"{name}'s probes", f"share of {name}'s"]
    rows = []
    for result in results:
        best = result.best
        row = [result.objects, result.noise, best.policy, _shown(best.mean), _floor(result)]
        for name in baselines:
            other = _named(result, name)
            row.append(_shown(other.mean) if other else "")
            row.append(_percent(best.against[name].ratio) if name in best.against else "")
        rows.append(row)
    yield "## At a glance"
    yield (
        "The strategy with the fewest probes at the mean, with 95 % intervals, beside the"
        " uninformed ones. It is the best of several on the same episodes, so its figures"
        " flatter it a little."
    )
    yield str(Table(heads, rows))
    yield from _worse_than_hits(results)


def _worse_than_hits(results: Sequence[SettingResult]) -> Iterator[str]:
    """Which informed strategies a random probe that touches is better than; none without it."""
    if not any(_named(result, HITS) for result in results):
        return
    worse = [
        f"{literal(f'{one.policy} on {result.objects}, {result.noise}')}:"
        f" {_signed(one.against[HITS].difference)} probes,"
        f" p {_p_value(one.against[HITS].p_value)}"
        for result in results
        for one in result.policies
        if one.policy not in UNINFORMED
        and one.against[HITS].difference.value > 0.0
        and one.against[HITS].p_value < SIGNIFICANT
    ]
    rule = f"paired permutation test, p below {SIGNIFICANT} after Holm's correction"
    if worse:
        yield f"Informed strategies that need more probes than {HITS} ({rule}):"
        yield items(worse)
    else:
        yield f"No informed strategy needs more probes than {HITS} in any setting ({rule})."


def setting_tables(result: SettingResult) -> Iterator[str]:
    """All strategies of one setting: their figures, and beside the uninformed ones."""
    best = [result.policies.index(result.best)]
    floor = "" if result.floor is None else f" Floor: {_floor(result)} probes."
    solvable = f"{100 * result.solvable.mean():.0f} % of them were solved by some strategy"
    heads = ["strategy", "solved", "probes, mean", "interquartile mean", "mean, if solvable"]
    heads += ["right answers", "ms to decide: median, 99 %"]
    yield f"### {literal(f'{result.objects}, {result.noise}')}"
    yield f"{result.episodes} episodes a strategy; {solvable}.{floor}"
    yield str(Table(heads, [_figures(one) for one in result.policies], best))
    baselines = [name for name in BASELINES if any(name in p.against for p in result.policies)]
    if baselines:
        heads = ["strategy"]
        for name in baselines:
            heads += [f"share of {name}'s", f"less {name}'s", "p"]
        yield str(Table(heads, [_beside(one, baselines) for one in result.policies], best))


def _figures(one: PolicyResult) -> list[str]:
    return [
        one.policy,
        _percent(one.solved),
        _shown(one.mean),
        _shown(one.middle),
        "" if np.isnan(one.mean_solvable) else f"{one.mean_solvable:.2f}",
        _right(one),
        _times(one),
    ]


def _beside(one: PolicyResult, baselines: Sequence[str]) -> list[str]:
    row = [one.policy]
    for name in baselines:
        found = one.against.get(name)
        row += (
            [_percent(found.ratio), _signed(found.difference), _p_value(found.p_value)]
            if found
            else ["", "", ""]
        )
    return row


def poses_table(results: Sequence[SettingResult]) -> Iterator[str]:
    """Poses left after 7 to 9 contacts."""
    policies = [one.policy for one in results[0].policies]
    rows = []
    for policy in policies:
        row = [policy]
        for result in results:
            one = _named(result, policy)
            median, most, many = one.poses_left if one else (np.nan, 0, 0)
            row.append(f"{median:g} ({most}), {many}" if many else "")
        rows.append(row)
    yield "## Poses left after 7 to 9 contacts"
    yield (
        "Hypotheses left after the first probe that brought the contacts to at least seven:"
        " median (most), episodes. One that was solved with fewer contacts counts as 1; one"
        " that was given up with fewer isn't counted. The memo (Section 4.4) has a median of 5"
        " and at most 14 poses on its housing at pi/8, 0.05 in, with random probes."
    )
    yield str(Table(["strategy", *(f"{r.objects}, {r.noise}" for r in results)], rows))


def decision_table(rows: Sequence[EpisodeRow]) -> Iterator[str]:
    """How long strategies think, over all settings."""
    shown = []
    for policy in dict.fromkeys(row.policy for row in rows):
        own = [row for row in rows if row.policy == policy]
        spent = 1e3 * np.array([s for row in own for s in row.decision_processor_seconds])
        clock = 1e3 * np.array([s for row in own for s in row.decision_seconds])
        # A decision comes after each probe but the last.
        rivals = [left for row in own for left in row.hypotheses[: len(row.decision_seconds)]]
        if not len(spent):
            shown.append([policy, "0", *[""] * 5])
            continue
        figures = [*np.percentile(spent, (50, 99)), spent.max(), *np.percentile(clock, (50, 99))]
        shown.append(
            [policy, f"{len(spent)}", *(_milliseconds(f) for f in figures), str(max(rivals))]
        )
    heads = ["strategy", "decisions", "median", "99 %", "most", "clock, median", "clock, 99 %"]
    yield "## Time to decide"
    yield (
        "Milliseconds of one processor core for one decision, over all settings; beside them"
        " those of the clock, which other work on the machine lengthens. What a process does"
        " once, such as loading compiled code, is left out."
    )
    yield str(Table([*heads, "most hypotheses"], shown))


def _named(result: SettingResult, policy: str) -> PolicyResult | None:
    return next((one for one in result.policies if one.policy == policy), None)


def _listed(names: Iterable[str]) -> str:
    """Each once, in the order in which they come."""
    return literal(", ".join(dict.fromkeys(names)))


def _shown(one: Estimate) -> str:
    return f"{one.value:.2f} [{one.low:.2f}, {one.high:.2f}]"


def _signed(one: Estimate) -> str:
    return f"{one.value:+.2f} [{one.low:+.2f}, {one.high:+.2f}]".replace("-", "−")


def _percent(one: Estimate) -> str:
    return f"{100 * one.value:.0f} % [{100 * one.low:.0f}, {100 * one.high:.0f}]"


def _p_value(p: float) -> str:
    return "< 0.001" if p < 0.001 else f"{p:.3f}"


def _floor(result: SettingResult) -> str:
    return "" if result.floor is None else f"{result.floor:.2f}"


def _right(one: PolicyResult) -> str:
    if one.right is None:
        return "none ended"
    low = 100 * one.right.low
    return f"{round(one.right.value * one.ended)} of {one.ended} (at least {low:.1f} %)"


def _times(one: PolicyResult) -> str:
    return ", ".join(map(_milliseconds, one.decision_ms)) if one.decision_ms else ""


def _milliseconds(value: float) -> str:
    return f"{value:.2f}" if value < 9.995 else f"{value:.0f}"
