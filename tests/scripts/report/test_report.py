"""`palpate report`: what a page says, in Markdown and in HTML."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.made_up_rows import made_up_row, small
from helpers.shown_page import Shown
from markdown_it import MarkdownIt

from palpate.scripts.benchmark.run import run_benchmark
from palpate.scripts.benchmark.store import RowStore
from palpate.scripts.report.plots import style_of
from palpate.scripts.report.report import write_report
from palpate.scripts.report.results import poses_left, settle

POLICIES = ("random", "random-hit", "quick", "lost")
CURVES = ("probes", "unsolved", "left")
NEEDED = {"random": 10, "random-hit": 8, "quick": 4, "lost": 99}


def played(folder: Path, **changes) -> Path:
    config = small(policies=POLICIES, episodes=12, **changes)

    def play(job):
        return made_up_row(job, probes=NEEDED[job.policy])

    run_benchmark(config, folder, play)
    return folder


def tables(page: str) -> list[list[list[str]]]:
    """Rows of cells of each table of a Markdown page."""
    found = re.findall(r"((?:^\|.*\|\n)+)", page, re.MULTILINE)
    return [
        [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
        for table in found
    ]


def test_a_page_has_the_figures_of_its_rows(tmp_path):
    write_report(played(tmp_path), tmp_path / "page")
    page = (tmp_path / "page.md").read_text()
    glance, setting, compared, poses, decisions = tables(page)
    assert glance[2][2:4] == ["quick", "4.00 [4.00, 4.00]"]
    assert glance[2][5:] == [
        "10.00 [10.00, 10.00]",
        "40 % [40, 40]",
        "8.00 [8.00, 8.00]",
        "50 % [50, 50]",
    ]
    rows = {row[0].strip("*"): dict(zip(setting[0], row, strict=True)) for row in setting[2:]}
    assert list(rows) == list(POLICIES)
    assert rows["quick"]["solved"] == "100 % [76, 100]"
    assert rows["quick"]["right answers"] == "12 of 12 (at least 75.8 %)"
    assert rows["lost"]["probes, mean"] == "21.00 [21.00, 21.00]"
    assert rows["lost"]["solved"] == "0 % [0, 24]"
    assert rows["lost"]["right answers"] == "none ended"
    beside = {row[0].strip("*"): row[1:] for row in compared[2:]}
    # 2 of the 2^12 signs are as far, for each of three strategies.
    assert beside["quick"][:3] == ["40 % [40, 40]", "−6.00 [−6.00, −6.00]", "0.001"]
    assert beside["quick"][3:] == ["50 % [50, 50]", "−4.00 [−4.00, −4.00]", "0.001"]
    assert beside["random"][:3] == ["", "", ""]
    # After 4 probes and 8 contacts: of 10 probes 8 were left, of 8 six; quick had found it.
    assert [row[1] for row in poses[2:]] == ["8 (8), 12", "6 (6), 12", "1 (1), 12", "18 (18), 12"]
    assert [row[1] for row in decisions[2:]] == ["108", "84", "36", "228"]
    assert "counts as 21" in page
    assert "palpate benchmark --policies random,random-hit,quick,lost" in page
    assert "seeds 0 to 11" in page
    assert "palpate 0.1.0, python 3.11" in page
    assert "12 episodes a strategy; 100 % of them were solved by some strategy. Floor: 2.00" in page


def test_a_page_names_informed_strategies_that_are_worse_than_random_hits(tmp_path):
    write_report(played(tmp_path), tmp_path / "page")
    page = (tmp_path / "page.md").read_text()
    # random is worse too, but asks for nothing.
    assert re.findall(r"^- (\S+) on .*: \+13.00 .* probes, p 0.001$", page, re.MULTILINE) == [
        "lost"
    ]
    config = small(policies=POLICIES[:3], episodes=12)
    run_benchmark(config, tmp_path / "b", lambda job: made_up_row(job, probes=NEEDED[job.policy]))
    write_report(tmp_path / "b", tmp_path / "better")
    page = (tmp_path / "better.md").read_text()
    assert "No informed strategy needs more probes than random-hit in any setting" in page


def test_the_html_page_needs_nothing_else(tmp_path):
    write_report(played(tmp_path), tmp_path / "page")
    page = (tmp_path / "page.html").read_text()
    shown = Shown(page)
    assert shown.loaded == []
    assert not re.search(r"url\(|@import", page)
    drawn = [(tmp_path / f"page-{name}-1.svg").read_bytes() for name in CURVES]
    assert shown.drawings == drawn


def test_both_pages_have_the_same_tables(tmp_path):
    write_report(played(tmp_path), tmp_path / "page")
    read = [
        [cell.strip("*") for cell in line]
        for table in tables((tmp_path / "page.md").read_text())
        for line in table
        if line[0] != "---"
    ]
    assert Shown((tmp_path / "page.html").read_text()).lines == read


def test_figures_lie_beside_the_page_under_the_names_it_says(tmp_path):
    folder = played(tmp_path / "run", noise=("pi/8,0.05in", "pi/10,0.01in"))
    beside = tmp_path / "to" / "be" / "made"
    write_report(folder, beside / "results")
    named = re.findall(r"\]\((.*?)\)", (beside / "results.md").read_text())
    assert len(named) == 6
    for name in named:
        assert (beside / name).read_bytes().startswith(b"<?xml")
        assert (beside / name).with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    assert sorted(p.name for p in folder.iterdir()) == [".lock", "config.json", "episodes.parquet"]


def test_the_same_rows_make_the_same_page(tmp_path):
    played(tmp_path)
    pages = []
    for name in ("once", "again"):
        write_report(tmp_path, tmp_path / name)
        pages.append((tmp_path / f"{name}.html").read_text())
    assert pages[0] == pages[1]


def test_episodes_that_some_strategy_hasnt_played_yet_arent_counted():
    jobs = list(small(policies=("random", "quick")).jobs())
    rows = [made_up_row(job, probes=4 + job.episode) for job in jobs]
    slow_ones_missing = [r for r in rows if not (r.policy == "quick" and r.episode >= 3)]
    result = settle(slow_ones_missing, ("random", "quick"), "simple-hand", "pi/8,0.05in")
    assert result is not None
    assert result.episodes == 3
    assert [one.mean.value for one in result.policies] == [5.0, 5.0]
    assert settle(rows[:1], ("random", "quick"), "simple-hand", "pi/8,0.05in") is None


def test_curves_start_at_the_first_probe_and_stay_where_an_episode_ended():
    jobs = [job for job in small().jobs() if job.policy == "random"][:2]
    rows = [made_up_row(jobs[0], probes=2), made_up_row(jobs[1], probes=4)]
    rows[1] = replace(rows[1], hypotheses=(0, 9, 3, 1))
    result = settle(rows, ("random",), "simple-hand", "pi/8,0.05in")
    assert result is not None
    (one,) = result.policies
    assert one.unsolved[:5].tolist() == [1.0, 0.5, 0.5, 0.0, 0.0]
    # The second hadn't touched the object after its first probe.
    assert one.left[:5].tolist() == [rows[0].hypotheses[0], 5.0, 2.0, 1.0, 1.0]


def test_wrong_answers_and_beliefs_that_end_empty_are_told():
    jobs = [job for job in small().jobs() if job.policy == "random"][:4]
    rows = [made_up_row(job, probes=3) for job in jobs]
    rows[1] = replace(rows[1], right=False)
    rows[2] = replace(rows[2], ended="nothing fits", right=False)
    result = settle(rows, ("random",), "simple-hand", "pi/8,0.05in")
    assert result is not None
    (one,) = result.policies
    assert one.right is not None
    assert (one.right.value, one.ended) == (0.5, 4)
    assert one.mean.value == (3 + 3 + 21 + 3) / 4


def test_poses_are_counted_after_seven_to_nine_contacts():
    row = made_up_row(next(small().jobs()), probes=5)
    assert poses_left(replace(row, contacts_felt=(3, 6, 9, 9, 12), hypotheses=(9, 8, 5, 3, 1))) == 5
    assert poses_left(replace(row, contacts_felt=(1, 2, 3, 4, 5))) == 1
    lost = replace(row, ended="gave up", contacts_felt=(1, 2, 3, 4, 5))
    assert poses_left(lost) is None
    assert poses_left(replace(row, contacts_felt=(3, 36, 39, 40, 41))) is None


@pytest.mark.parametrize("made", ["nothing", "empty", "begun"])
def test_a_folder_without_a_benchmark_is_refused(tmp_path, made):
    folder = tmp_path / "run"
    if made != "nothing":
        folder.mkdir()
    if made == "begun":
        played(folder)
        (folder / "episodes.parquet").unlink()
        RowStore(folder).add(made_up_row(next(small(policies=POLICIES).jobs())))
    says = "played by all strategies yet, 1 in all" if made == "begun" else "not the folder"
    with pytest.raises(ValueError, match=f"run: .*{says}"):
        write_report(folder, tmp_path / "page")
    assert not list(tmp_path.glob("page*"))


def test_thirteen_strategies_look_different_without_colour():
    styles = style_of([f"strategy {number}" for number in range(11)] + ["random", "random-hit"])
    looks = {(style["linestyle"], style["marker"]) for style in styles.values()}
    assert len(looks) == 13


NAMES = ("[a]", "a|b", "*a*", "_a_", "<b>", "`a`", "[a](b)", "a\\", "&amp;", "~~a~~", "<script>")


def test_names_come_out_letter_by_letter(tmp_path):
    objects = tmp_path / "<i>|[parts](*&lt;*)"
    objects.mkdir()
    config = small(policies=NAMES, objects=(str(objects),), episodes=2)
    run_benchmark(config, tmp_path / "run", made_up_row)
    write_report(tmp_path / "run", tmp_path / "page")
    markdown = MarkdownIt("commonmark").enable("table")
    for page in (
        (tmp_path / "page.html").read_text(),
        markdown.render((tmp_path / "page.md").read_text()),
    ):
        shown = Shown(page)
        lines = [line[0] for line in shown.lines]
        for name in NAMES:
            assert lines.count(name) == 3, name
        assert f"objects: {objects} (library" in shown.text
        assert f"strategies: {', '.join(NAMES)};" in shown.text
        assert f"{objects}, pi/8,0.05in" in shown.text.splitlines()
        assert not {"i", "b", "script", "a", "del"} & shown.elements
