"""`palpate view`: a page that changes as an episode runs, or as a file of touches grows."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from http.client import HTTPConnection
from pathlib import Path
from threading import Timer

import numpy as np
import pytest
import trimesh
from helpers.browser import CHROMIUM, browser
from oracles.solids import model, random_pose, surface_points

from palpate.assets import mesh_path
from palpate.envs.probe_env import ProbeEnv
from palpate.policies import make_policy
from palpate.recognizer import Recognizer, read_contacts
from palpate.scripts.benchmark.playing import probes, task_of
from palpate.scripts.commands.watching import Watched, watched_stories
from palpate.scripts.page.live_page import HOST, LivePage, serve
from palpate.scripts.page.story_episode import episode_stories

HEADER = "x,y,z,nx,ny,nz\n"


@pytest.fixture(scope="module")
def parts(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("parts")
    for name in ("housing", "simple-hand"):
        mesh = trimesh.load_mesh(mesh_path(name))
        mesh.apply_scale(1e3)
        mesh.export(folder / f"{name}.stl")
    return folder


@pytest.fixture(scope="module")
def rows() -> list[str]:
    """Lines of a file of touches on the housing."""
    rng = np.random.default_rng(3)
    solid, pose = model("housing"), random_pose(rng, 0.3)
    points, faces = surface_points(solid, 9, rng)
    values = np.hstack([1e3 * pose.apply(points), pose.rotation.apply(solid.normals[faces])])
    return [",".join(f"{value:.5f}" for value in row) + "\n" for row in values]


@pytest.fixture
def stories():
    env = ProbeEnv(object_name="complex-hand", max_probes=2)
    return episode_stories(env, make_policy("random", task_of(env)), 45)


def got(address: str, path: str = "", **headers: str) -> str:
    request = urllib.request.Request(address + path, headers=headers)
    with urllib.request.urlopen(request, timeout=10) as answer:
        return answer.read().decode()


def steps(address: str) -> int:
    return len(json.loads(got(address, "story.json"))["steps"])


def test_an_episode_is_told_before_it_starts_and_after_each_probe(stories):
    told = list(stories)
    assert [len(story.moments) for story in told] == [1, 2, 3, 3]
    assert [story.ending[0] != "" for story in told] == [False, False, False, True]
    env = ProbeEnv(object_name="complex-hand", max_probes=2)
    for probed, moment in zip(
        probes(env, make_policy("random", task_of(env)), 45), told[-1].moments[1:], strict=True
    ):
        np.testing.assert_array_equal(probed.contacts.positions, moment.contacts.positions)
        np.testing.assert_array_equal(probed.T_world_object.as_matrix(), moment.T_world_truth)


def test_the_page_is_served_on_the_loopback_alone_and_follows_the_story(stories):
    live = LivePage.of(next(stories))
    with serve(live) as address:
        assert address.startswith("http://127.0.0.1:")
        assert HOST == "127.0.0.1"
        page = got(address)
        assert 'data-live="yes"' in page
        assert "connect-src 'self'" in page
        assert steps(address) == 1
        events = HTTPConnection(address.split("/")[2], timeout=10)
        events.request("GET", "/events")
        told = events.getresponse()
        assert told.getheader("Content-Type") == "text/event-stream"
        assert told.readline() + told.readline() == b"data: 0\n\n"
        live.tell(next(stories))
        assert told.readline() + told.readline() == b"data: 1\n\n"
        assert steps(address) == 2
        events.close()
    with pytest.raises(urllib.error.URLError):
        got(address)


def test_foreign_pages_and_unknown_paths_are_refused(stories):
    with serve(LivePage.of(next(stories))) as address:
        for path, headers, code in (
            ("", {"Host": "evil.example"}, 403),
            ("story.json", {"Host": "evil.example:80"}, 403),
            ("../etc/passwd", {}, 404),
        ):
            with pytest.raises(urllib.error.HTTPError) as refused:
                got(address, path, **headers)
            assert refused.value.code == code
            refused.value.close()


def test_a_port_that_is_taken_is_said(stories):
    live = LivePage.of(next(stories))
    with serve(live) as address:
        port = int(re.findall(r":(\d+)/", address)[0])
        with pytest.raises(ValueError, match=f"port {port}: "), serve(live, port):
            pass


def test_a_file_is_recognised_again_as_it_grows(parts, rows, tmp_path):
    path, notices, waits = tmp_path / "felt.csv", [], []

    def wait(seconds: float) -> None:
        waits.append(seconds)
        assert len(waits) < 10, "nothing new was noticed"
        path.write_text(next(versions))

    stories = watched_stories(Watched(path=path, library=parts), notices.append, wait)
    versions = iter(
        (
            HEADER,
            HEADER + rows[0],
            HEADER + rows[0] + "3,four",
            HEADER + "".join(rows[:3]),
            HEADER + "".join(rows),
        )
    )
    told = [next(stories) for _ in range(5)]
    assert [len(story.moments) for story in told] == [1, 1, 2, 4, 10]
    assert len(notices) == 1
    assert "felt.csv, line 3: x, y but no z" in notices[0]
    felt = read_contacts(path, position_error=1e-4, normal_error=np.radians(15.0), scale=1e-3)
    fresh = Recognizer(told[-1].models).recognize(felt.contacts)
    last = told[-1].moments[-1].belief
    assert last is not None
    assert [one.object_name for one in last.hypotheses] == ["housing"]
    np.testing.assert_array_equal(
        last.hypotheses[0].T_world_object, fresh.hypotheses[0].T_world_object
    )
    # What the first touches say is not worked out again.
    assert told[-1].moments[3].belief is told[-2].moments[3].belief


def test_a_touch_that_was_changed_is_worked_out_again(parts, rows, tmp_path):
    path = tmp_path / "felt.csv"
    path.write_text(HEADER + rows[0] + rows[1] + rows[2])
    stories = watched_stories(
        Watched(path=path, library=parts),
        pytest.fail,
        lambda _: path.write_text(HEADER + rows[0] + rows[3] + rows[2]),
    )
    first, second = next(stories), next(stories)
    assert first.moments[1].belief is second.moments[1].belief
    assert first.moments[2].belief is not second.moments[2].belief


def test_the_command_watches_until_it_is_interrupted(parts, rows, tmp_path):
    path = tmp_path / "felt.csv"
    path.write_text(HEADER + "".join(rows[:4]))
    command = ["view", "--contacts", str(path), "--library", str(parts), "--no-browser"]
    program = "from palpate.scripts.cli import main; main()"
    with subprocess.Popen(
        [sys.executable, "-u", "-c", program, *command], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        late = Timer(120.0, process.kill)  # nobody measures how fast: the machine may be busy
        late.start()
        try:
            address = process.stdout.readline().split()[0]
            assert steps(address) == 5
            with path.open("a") as file:
                file.writelines(rows[4:])
            assert "Touch 9: 1 left (housing 1)" in process.stdout.readline()
            assert steps(address) == 10
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
        finally:
            process.kill()
            late.cancel()


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
def test_a_browser_follows(stories, tmp_path):
    live = LivePage.of(next(stories))
    with serve(live) as address, browser(tmp_path / "profile") as tab:
        tab.open(address)
        assert tab.ask("document.body.dataset.step") == "0"
        live.tell(next(stories))
        tab.wait("document.body.dataset.step === '1'")
        live.tell(next(stories))
        tab.wait("document.body.dataset.step === '2'")
        tab.wait("document.getElementById('verdict').textContent.startsWith('1 rival left')")
        assert {url.removeprefix(address) for url in tab.requests()} == {"", "events", "story.json"}
        assert tab.complaints() == []
