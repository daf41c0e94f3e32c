"""The page to look at: what its story says, and that a real browser shows it without a network."""

from __future__ import annotations

import io
import json
import re
from base64 import b64decode
from collections import Counter
from dataclasses import replace
from hashlib import sha256
from importlib import resources
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
import trimesh
from helpers.browser import CHROMIUM, Tab, browser
from oracles.solids import model, random_pose, surface_points
from PIL import Image

from palpate.assets import mesh_path
from palpate.envs.probe_env import ProbeEnv
from palpate.policies import make_policy
from palpate.recognizer import Constraints, Contacts, FeltFile, FreeSpace, Recognizer
from palpate.recognizer.tree.tree import prune, spread_order
from palpate.scripts.benchmark.playing import task_of
from palpate.scripts.cli import app
from palpate.scripts.page import story_contacts
from palpate.scripts.page.page import CORE, MODULES, check_page_path, page, story_json, write_page
from palpate.scripts.page.story import Story
from palpate.scripts.page.story_contacts import Beliefs, contacts_story
from palpate.scripts.page.story_episode import episode_stories
from palpate.scripts.page.tree_count import CUTS, count_branches

needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
ODD_NAME = "</script><b>x & \u2028"


@pytest.fixture(scope="module")
def story() -> Story:
    """Four probes: the first leaves a hundred hypotheses, the last one."""
    env = ProbeEnv(object_name="complex-hand")
    *_, last = episode_stories(env, make_policy("random", task_of(env)), 45)
    assert len(last.moments) == 5
    return last


@pytest.fixture(scope="module")
def document(story) -> dict:
    return json.loads(story_json(story))


def touched(name: str, count: int, seed: int = 3) -> Contacts:
    rng = np.random.default_rng(seed)
    solid, pose = model(name), random_pose(rng, 0.3)
    points, faces = surface_points(solid, count, rng)
    normals = pose.rotation.apply(solid.normals[faces])
    return Contacts(pose.apply(points), normals, position_error=1e-4, normal_error=0.2)


def test_the_page_has_the_shapes_and_places_that_the_episode_had(story, document):
    for told, solid in zip(document["objects"], story.models, strict=True):
        vertices = np.frombuffer(b64decode(told["vertices"]), "<f4").reshape(-1, 3)
        triangles = np.frombuffer(b64decode(told["triangles"]), "<u4").reshape(-1, 3)
        np.testing.assert_allclose(vertices, solid.vertices, atol=1e-6)
        np.testing.assert_array_equal(triangles, solid.triangles)
    for told, moment in zip(document["steps"], story.moments, strict=True):
        felt = np.array(told["contacts"]).reshape(-1, 6)
        np.testing.assert_allclose(felt[:, :3], moment.contacts.positions, atol=1e-6)
        np.testing.assert_allclose(felt[:, 3:], moment.contacts.normals, atol=1e-6)
        np.testing.assert_allclose(
            np.reshape(told["truth"], (3, 4)), moment.T_world_truth[:3], atol=1e-6
        )
        left = moment.belief.hypotheses if moment.belief else ()
        names = Counter(one.object_name for one in left)
        shown = {document["objects"][index]["name"]: n for index, n, _ in told["shares"]}
        assert shown == names


def test_a_rival_lives_as_long_as_a_hypothesis_extends_it(story, document):
    beliefs = [moment.belief for moment in story.moments]
    assert {rival["died"] for rival in document["rivals"]} == {None, 2}
    for rival in document["rivals"]:
        name = document["objects"][rival["object"]]["name"]
        stop = len(beliefs) if rival["died"] is None else rival["died"]
        assert len(rival["poses"]) == stop - rival["born"]
        lines: list[set[bytes]] = []
        for step, pose in zip(range(rival["born"], stop), rival["poses"], strict=True):
            (one,) = (
                hypothesis
                for hypothesis in beliefs[step].hypotheses
                if hypothesis.object_name == name
                and np.allclose(hypothesis.T_world_object[:3].ravel(), pose, atol=2e-6)
            )
            rows = one.interpretations
            if lines:
                before = len(next(iter(lines[-1]))) // rows.itemsize
                assert {row[:before].tobytes() for row in rows} & lines[-1]
            lines.append({row.tobytes() for row in rows})
        if rival["died"] is not None:
            first = len(next(iter(lines[-1]))) // 4
            heirs = {
                row[:first].tobytes()
                for hypothesis in beliefs[stop].hypotheses
                if hypothesis.object_name == name
                for row in hypothesis.interpretations
            }
            assert not heirs & lines[-1]


def test_branches_are_counted_as_the_tree_itself_prunes(story):
    belief = story.moments[-1].belief
    contacts = belief.contacts[spread_order(belief.contacts)]
    for tree in count_branches(belief):
        tables = belief.library.solid(tree.object_name).tables
        live = 1
        for depth, level in enumerate(tree.levels):
            assert level.tried == live * tables.face_count
            assert level.tried == sum(level.cut) + level.left
            live = level.left
            if depth in (1, len(tree.levels) - 1):
                # An independent search, by look-ahead instead of level by level.
                found = prune(tables, contacts[: depth + 1], sort=False).faces
                assert len(found) == level.left
        assert tree.whole
        assert tree.fits.sum() == tree.held
    assert sum(tree.held for tree in count_branches(belief)) == belief.interpretations


def test_a_branch_is_counted_under_the_first_constraint_that_it_breaks(story):
    belief = story.moments[1].belief
    pair = belief.contacts[spread_order(belief.contacts)][:2]
    none = {"distance": False, "angle": False, "component": False}
    cut_at_all = np.zeros(3, int)
    for tree in count_branches(belief):
        tables, level = belief.library.solid(tree.object_name).tables, tree.levels[1]
        left = level.tried
        for number, name in enumerate(("distance", "angle", "component")):
            none[name] = True
            switched = prune(tables, pair, constraints=Constraints(**none), sort=False)
            cut = level.cut[CUTS.index(name)]
            assert left - cut == len(switched.faces)
            left, cut_at_all[number] = len(switched.faces), cut_at_all[number] + cut
        none = dict.fromkeys(none, False)
    assert (cut_at_all > 0).all()


def test_outliers_have_their_branch_in_the_tree():
    contacts = touched("housing", 5)
    moved = contacts.positions + np.where(np.arange(5) == 2, 0.5, 0.0)[:, None]
    odd = Contacts(moved, contacts.normals, position_error=1e-4, normal_error=0.2)
    belief = Recognizer([model("housing"), model("stapler")]).recognize(odd, outliers=1)
    assert belief.interpretations
    for tree in count_branches(belief):
        assert tree.fits.sum() == tree.held


def test_a_kind_of_contact_cuts_what_is_of_another_kind():
    contacts = touched("simple-hand", 3)
    faces = Contacts(
        contacts.positions, contacts.normals, position_error=1e-4, normal_error=0.2, kinds=1
    )
    belief = Recognizer([model("simple-hand")], features="all").recognize(faces)
    (tree,) = count_branches(belief)
    solid = model("simple-hand")
    assert tree.levels[0].left == solid.face_count
    assert tree.levels[0].cut[CUTS.index("kind")] == tree.levels[0].tried - solid.face_count > 0


def contacts_page(name: str = "felt.csv") -> Story:
    contacts = touched("housing", 4)
    models = [replace(model("housing"), name=ODD_NAME), model("simple-hand")]
    recognizer = Recognizer(models)
    felt = FeltFile(contacts, FreeSpace.none(), (2, 3, 4, 5), 0)
    beliefs = Beliefs.of(felt, recognizer.recognize(contacts), recognizer)
    return contacts_story(name, recognizer, beliefs, ("mm", 1e-3))


def test_contacts_are_told_one_by_one_as_if_the_others_had_not_been_made():
    told = contacts_page()
    assert [moment.new for moment in told.moments] == [0, 1, 1, 1, 1]
    counts, recognizer = [], Recognizer(told.models)
    for moment in told.moments[1:]:
        assert moment.belief is not None
        counts.append(len(moment.belief.hypotheses))
        alone = recognizer.recognize(moment.contacts)
        assert len(alone.hypotheses) == counts[-1]
    assert told.truth is None
    assert counts[-1] < counts[1]


def test_ways_are_drawn_where_they_pass_and_what_met_nothing_comes_last():
    contacts = touched("housing", 3)
    starts = contacts.positions + 0.1 * contacts.normals
    middle = contacts.positions.mean(axis=0)
    miss = middle + [[-3.0, 0.0, 0.5], [3.0, 0.0, 0.5]]
    ways = FreeSpace(
        np.vstack([starts, miss[:1]]), np.vstack([contacts.positions, miss[1:]]), error=1e-4
    )
    recognizer = Recognizer([model("housing")])
    belief = recognizer.recognize(contacts, free_space=ways)
    felt = FeltFile(contacts, ways, (2, 3, 4), 1)
    told = contacts_story("t", recognizer, Beliefs.of(felt, belief, recognizer), ("mm", 1e-3))
    assert told.moments[-1].belief is belief
    way = told.moments[-1].ways
    assert np.abs(way.starts - middle)[0, 0] < 0.3
    np.testing.assert_allclose([way.starts[0, 2], way.ends[0, 2]], middle[2] + 0.5)
    np.testing.assert_allclose(told.moments[1].ways.ends, contacts.positions[:1])


def walked() -> tuple[FeltFile, Recognizer]:
    """Five touches with the ways to them."""
    contacts = touched("housing", 5)
    ways = FreeSpace(contacts.positions + 0.1 * contacts.normals, contacts.positions, error=1e-4)
    return FeltFile(contacts, ways, (2, 3, 4, 5, 6), 0), Recognizer([model("housing")])


def test_ways_count_for_as_many_interpretations_as_are_soon_held_against_them(monkeypatch):
    felt, recognizer = walked()
    final = recognizer.recognize(felt.contacts, free_space=felt.free_space)
    plain = [recognizer.recognize(felt.contacts[: n + 1]).interpretations for n in range(4)]
    most = plain[3]
    assert plain[2] > most
    monkeypatch.setattr(story_contacts, "MOST_WITH_WAYS", most)
    told = Beliefs.of(felt, final, recognizer)
    counted = {size: len(belief.free_space) for size, belief in told.by_count.items()}
    assert counted == {1: 0, 2: 0, 3: 0, 4: 4, 5: 5}
    story = contacts_story("t", recognizer, told, ("mm", 1e-3))
    late = [moment.told.endswith("the way there doesn't count yet") for moment in story.moments[1:]]
    assert late == [True, True, True, False, False]


@pytest.mark.parametrize("name", ["MOST_INTERPRETATIONS", "MOST_NODES"])
def test_beliefs_that_would_take_long_are_left_out_by_count(name, monkeypatch):
    felt, recognizer = walked()
    final = recognizer.recognize(felt.contacts)
    most = {
        "MOST_INTERPRETATIONS": recognizer.recognize(felt.contacts[:3]).interpretations + 1,
        "MOST_NODES": story_contacts._nodes(final),
    }
    monkeypatch.setattr(story_contacts, name, most[name])
    told = Beliefs.of(felt, final, recognizer)
    assert set(told.by_count) < {1, 2, 3, 4, 5}
    assert set(told.by_count) == set(range(min(told.by_count), 6)), "the last ones are told"
    story = contacts_story("t", recognizer, told, ("mm", 1e-3))
    assert story.moments[1].told == "line 2 of the file; not worked out, so much fits"
    monkeypatch.setattr(story_contacts, name, 0)
    before = Beliefs.of(felt, final, recognizer, earlier=told)
    assert before.by_count == told.by_count, "what was worked out before stays"


def test_models_of_many_triangles_do_not_make_a_page_too_large():
    ball = replace(model("housing"), **sphere())
    told = contacts_page()
    before = replace(told.moments[0], T_world_truth=np.eye(4))
    told = replace(told, models=(model("stapler"), ball), truth="ball", moments=(before,))
    assert len(page(story_json(told))) < 5e6
    unseen, drawn = json.loads(story_json(told))["objects"]
    assert list(unseen) == ["name"]
    assert drawn["triangles"] == ""
    assert len(drawn["edges"]) > 1000


def sphere() -> dict:
    """Of 81,920 triangles that are in six faces, as far as a picture goes."""
    mesh = trimesh.creation.icosphere(subdivisions=6)
    normals = np.hstack([mesh.face_normals, -mesh.face_normals])
    return {
        "name": "ball",
        "vertices": np.array(mesh.vertices),
        "triangles": np.array(mesh.faces),
        "triangle_faces": normals.argmax(axis=1),
    }


def test_one_file_that_asks_for_nothing_and_is_small(story, tmp_path):
    size = write_page(story, tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert size == len(text.encode()) < 1e6
    assert "default-src 'none'" in text
    own = text.replace("http://www.w3.org/1999/xhtml", "")  # a name, not a place
    own = own.replace("https://jcgt.org/published/0007/04/01/", "")  # a comment in a shader
    assert re.findall(r"https?://[^\s'\"<]+", own) == []
    assert re.findall(r"<(?:script|img|iframe|link)[^>]*(?:src|href)=[\"'](?!data:)", own) == []
    assert "three.js authors" in text
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]


def test_the_viewer_is_the_files_that_sources_names_and_no_others():
    folder = Path(str(resources.files("palpate.assets")))
    told = (folder / "SOURCES.md").read_text(encoding="utf-8")
    named = dict(re.findall(r"^\| `([\w.-]+)` \| `[\w./]+` \| `([0-9a-f]{64})` \|$", told, re.M))
    assert set(named) == {*MODULES.values(), "three-LICENSE.txt"}
    for name, digest in named.items():
        assert sha256((folder / "page" / name).read_bytes()).hexdigest() == digest, name


def test_modules_stand_in_a_page_as_they_are_but_for_the_name_of_one():
    text = page("{}")
    (modules,) = re.findall(r'<script type="importmap">(.*?)</script>', text)
    for name, address in json.loads(modules)["imports"].items():
        told = unquote(address.removeprefix("data:text/javascript;charset=utf-8,"))
        whole = (resources.files("palpate.assets") / "page" / MODULES[name]).read_text("utf-8")
        assert told.replace('"three/core"', f'"{CORE}"') == whole
        assert (told != whole) == (name == "three")


def test_where_no_page_can_be_written_is_said(story, tmp_path):
    for name, words in (("a.txt", "ends in .html"), ("no/a.html", "there is no folder")):
        with pytest.raises(ValueError, match=words):
            check_page_path(tmp_path / name)


def test_palpate_episode_writes_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ["--object", "complex-hand", "--max-probes", "2", "--no-picture", "--json"]
    app(["episode", *options, "--html", "a.html"], standalone_mode=False)
    json.loads(capsys.readouterr().out)
    told = story_in(tmp_path / "a.html")
    assert [step["title"] for step in told["steps"]][1:] == ["Probe 1", "Probe 2"]
    assert told["ending"][0] == "Not unique: 1 hypothesis left"
    with pytest.raises(ValueError, match=r"ends in \.html"):
        app(["episode", *options, "--html", "a.txt"], standalone_mode=False)


def test_palpate_recognize_writes_it(tmp_path, capsys):
    contacts = touched("housing", 9)
    rows = np.hstack([1e3 * contacts.positions, contacts.normals])
    np.savetxt(tmp_path / "felt.csv", rows, "%.5f", ",", header="x,y,z,nx,ny,nz", comments="")
    (tmp_path / "parts").mkdir()
    for name in ("housing", "simple-hand"):
        mesh = trimesh.load_mesh(mesh_path(name))
        mesh.apply_scale(1e3)
        mesh.export(tmp_path / "parts" / f"{name}.stl")
    options = ["--library", str(tmp_path / "parts"), "--html", str(tmp_path / "b.html")]
    app(["recognize", str(tmp_path / "felt.csv"), *options], standalone_mode=False)
    assert "opens in a browser" in capsys.readouterr().out
    told = story_in(tmp_path / "b.html")
    assert len(told["steps"]) == 10
    assert told["unit"] == ["mm", 1e-3]
    assert told["ending"][0] == "It is housing"


def story_in(path: Path) -> dict:
    text = path.read_text(encoding="utf-8")
    (found,) = re.findall(r'<script type="application/json" id="story">(.*?)</script>', text)
    return json.loads(found)


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    with browser(tmp_path_factory.mktemp("profile")) as tab:
        yield tab


@pytest.fixture(scope="module")
def address(story, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("page") / "a.html"
    write_page(story, path)
    return path.as_uri()


def colours(tab: Tab, width: int) -> np.ndarray:
    """What the left part of the window shows."""
    tab.ask("new Promise((done) => setTimeout(done, 400))")  # until still pictures are drawn
    with Image.open(io.BytesIO(tab.screenshot())) as picture:
        return np.asarray(picture.convert("RGB"))[80 : 7 * width // 9, :width].astype(int)


@needs_browser
def test_a_browser_shows_it_and_asks_for_nothing(tab, address):
    tab.told.clear()
    tab.open(f"{address}#step=1")
    seen = colours(tab, 900)
    assert len(np.unique(seen.reshape(-1, 3), axis=0)) > 500
    red, green, blue = seen[..., 0], seen[..., 1], seen[..., 2]
    assert ((red > 170) & (green < 120) & (blue < 60)).sum() > 100, "contacts are vermilion"
    assert tab.ask("document.getElementById('nogl').hidden")
    assert [url.split("#")[0] for url in tab.requests()] == [address]
    assert tab.complaints() == []


@needs_browser
def test_the_browser_refuses_what_the_page_would_load(tab, address):
    tab.open(f"{address}#step=0")
    refused = "fetch('data:,x').then(() => 'loaded', () => 'refused')"
    assert tab.ask(refused) == "refused"


@needs_browser
def test_keys_step_and_play(tab, address, story):
    many = len(story.moments[1].belief.hypotheses)
    assert many > 1
    tab.open(f"{address}#step=0")
    assert tab.ask("document.body.dataset.step") == "0"
    tab.press("ArrowRight")
    tab.wait("document.body.dataset.step === '1'")
    tab.wait(f"document.getElementById('verdict').textContent.startsWith('{many} rivals left')")
    tab.press("End")
    tab.wait("document.body.dataset.step === '4'")
    assert "It is complex-hand" in tab.ask("document.getElementById('verdict').textContent")
    tab.press("ArrowLeft")
    tab.wait("document.body.dataset.step === '3'")
    tab.press("Home")
    tab.press(" ")
    tab.wait("document.body.dataset.step === '2'")
    tab.press(" ")


@needs_browser
def test_keys_and_mouse_turn_the_view(tab, address):
    tab.open(f"{address}#step=4")
    first = colours(tab, 900)
    tab.press("3")
    above = colours(tab, 900)
    assert np.abs(above - first).max() > 100
    tab.press("0")
    np.testing.assert_array_equal(colours(tab, 900), first)
    for kind, x in (("mousePressed", 400), ("mouseMoved", 520), ("mouseReleased", 520)):
        tab.call(
            "Input.dispatchMouseEvent",
            type=kind,
            x=x,
            y=400,
            button="left",
            buttons=1,
            clickCount=1,
        )
    assert np.abs(colours(tab, 900) - first).max() > 100
    tab.press("t")
    tab.press("r")
    hidden = colours(tab, 900)
    assert np.abs(hidden - first).max() > 50


@needs_browser
def test_it_fits_on_a_small_screen(tab, address):
    tab.open(f"{address}#step=1", 380, 800)
    assert tab.ask("document.documentElement.scrollWidth") == 380
    wide = "[...document.querySelectorAll('#panel *')].filter((e) => e.scrollWidth > 381).length"
    assert tab.ask(wide) == 0
    top, below = (
        tab.ask(f"document.getElementById('{name}').getBoundingClientRect().top")
        for name in ("stage", "panel")
    )
    assert top < below < 500
    assert len(np.unique(colours(tab, 380).reshape(-1, 3), axis=0)) > 300


@needs_browser
def test_a_name_is_a_name_whatever_it_is(tab, tmp_path):
    write_page(contacts_page(ODD_NAME), tmp_path / "odd.html")
    tab.told.clear()
    tab.open((tmp_path / "odd.html").as_uri() + "#step=4")
    assert tab.ask("document.getElementById('title').textContent") == ODD_NAME
    assert ODD_NAME in tab.ask("document.getElementById('shares').textContent")
    assert tab.ask("document.querySelectorAll('b').length > 0")
    assert tab.complaints() == []
