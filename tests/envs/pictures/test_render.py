"""Rendering: what the environments show of an episode under way, and that they clean up."""

from __future__ import annotations

import os
import pickle
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import palpate.envs
from palpate.envs.pictures import renderer, window
from palpate.envs.pictures import view as picture_view
from palpate.envs.pictures.episode import Episode
from palpate.envs.pictures.episode_picture import episode_so_far
from palpate.envs.probe_env import ProbeEnv

gymnasium.register_envs(palpate.envs)

IDS = ("palpate/Probe-v0", "palpate/ProbeRest-v0", "palpate/ProbeFinger-v0")
ACTION = np.array([0.1, 0.0, 0.2])


def near(image, colour, tolerance=0.15):
    return np.abs(image / 255 - np.array(colour)).max(axis=-1) < tolerance


@pytest.fixture
def no_gl(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")


@pytest.fixture
def env():
    made = ProbeEnv(("simple-hand", "complex-hand"), render_mode="rgb_array")
    yield made
    made.close()


@pytest.mark.usefixtures("no_gl")
@pytest.mark.parametrize("name", IDS)
def test_every_id_renders_within_gymnasiums_contract(name, monkeypatch):
    monkeypatch.setattr("palpate.envs.pictures.episode_view.SIZE", (80, 60))
    monkeypatch.setattr(window, "toolkit_name", lambda: "toy")
    monkeypatch.setattr(window.Window, "show", lambda *_: None)
    made = gymnasium.make(name, library=("simple-hand",), max_probes=3, render_mode="rgb_array")
    assert isinstance(made.unwrapped, ProbeEnv)
    check_env(made.unwrapped)
    made.reset(seed=0)
    picture = made.render()
    assert isinstance(picture, np.ndarray)
    assert (picture.shape, picture.dtype) == ((60, 80, 3), np.uint8)
    made.close()


def test_a_picture_shows_object_contacts_and_rays(env):
    env.reset(seed=0)
    before = env.render()
    assert near(before, picture_view.OBJECT).sum() > 5000
    assert near(before, picture_view.CONTACT)[100:500].sum() == 0
    env.step(ACTION)
    after = env.render()
    assert len(env.contacts)
    assert near(after, picture_view.CONTACT)[100:500].sum() > 100
    assert near(after, picture_view.RAY_HIT)[100:500].sum() > 20
    assert before.shape == after.shape == (600, 800, 3)
    # What was not touched stays where it was: the camera does not move.
    assert (np.abs(before.astype(int) - after).max(axis=-1) < 20)[100:500].mean() > 0.4


def test_rendering_is_the_same_to_the_bit_and_changes_no_episode(env):
    other = ProbeEnv(("simple-hand", "complex-hand"), render_mode="rgb_array")
    silent = ProbeEnv(("simple-hand", "complex-hand"))
    for each in (env, other, silent):
        each.reset(seed=3)
    for _ in range(2):
        drawn, again = env.render(), other.render()
        assert drawn is not None
        assert again is not None
        assert np.array_equal(drawn, again)
        assert silent.render() is None
        seen, _, unseen = (each.step(ACTION)[0] for each in (env, other, silent))
        assert all(np.array_equal(seen[key], unseen[key]) for key in seen)
    other.close()


@pytest.mark.usefixtures("no_gl")
def test_rendering_needs_no_gl(env, monkeypatch):
    monkeypatch.setattr("palpate.envs.pictures.episode_view.SIZE", (200, 150))
    env.reset(seed=0)
    env.step(ACTION)
    picture = env.render()
    assert picture.shape == (150, 200, 3)
    assert env._view._renderer.name == "NumPy"
    assert near(picture, picture_view.CONTACT, 0.25).any()


def test_rendering_survives_a_gl_library_that_kills(env, monkeypatch):
    """The process that draws is one that dies at once."""
    monkeypatch.setattr("palpate.envs.pictures.episode_view.SIZE", (200, 150))
    monkeypatch.setattr(renderer.sys, "executable", "/bin/false")
    env._view.close()
    env.reset(seed=0)
    assert env.render().shape == (150, 200, 3)
    assert env._view._renderer.name == "NumPy"


def test_the_leading_rivals_are_ghosts_of_several_objects_but_never_the_truth(env):
    _, info = env.reset(seed=0)
    assert not episode_so_far(Episode.of(env, info)).ghosts
    *_, info = env.step(ACTION)
    episode = Episode.of(env, info)
    assert env.belief is not None
    ghosts = episode_so_far(episode).ghosts
    names = {hypothesis.object_name for hypothesis in env.belief.hypotheses}
    assert 0 < len(ghosts) <= 3
    assert len(names) == 2
    assert {ghost.label for ghost in ghosts} == names
    truth = episode.T_world_object.apply(episode.true_object.vertices)
    for ghost in ghosts:
        same = ghost.vertices_world.shape == truth.shape
        assert not (same and np.allclose(ghost.vertices_world, truth, atol=1e-3))


def test_of_many_rays_only_the_ends_that_met_nothing_are_drawn():
    env = ProbeEnv(("simple-hand",), sensor="range-grid")
    env.reset(seed=0)
    *_, info = env.step(np.zeros(3))
    episode = Episode.of(env, info)
    scene = episode_so_far(episode)
    assert len(env.contacts) == len(scene.contacts_world) > 3
    assert not scene.ray_hits.any()
    lengths = np.linalg.norm(scene.rays_world[:, 1] - scene.rays_world[:, 0], axis=1)
    assert lengths.max() < 0.1 * episode.true_object.diameter


def test_an_environment_that_renders_can_be_pickled_and_closed_twice(env):
    env.reset(seed=0)
    drawn = env.render()
    copy = pickle.loads(pickle.dumps(env))
    assert np.array_equal(copy.render(), drawn)
    for each in (env, copy):
        each.close()
        each.close()
    if sys.platform == "linux":
        children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
        commands = [Path(f"/proc/{child}/cmdline").read_text() for child in children]
        assert not [command for command in commands if "pictures.gl" in command]


def test_rendering_before_the_first_reset_is_refused(env):
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.render()


def test_a_mode_that_there_is_not_is_named():
    with pytest.raises(ValueError, match=r"'ansi'.*human.*rgb_array"):
        ProbeEnv(render_mode="ansi")


def test_a_window_where_none_can_open_is_refused_with_a_word_on_what_would_do(monkeypatch):
    monkeypatch.setattr(window, "toolkit_name", lambda: None)
    with pytest.raises(gymnasium.error.DependencyNotInstalled, match="rgb_array"):
        ProbeEnv(render_mode="human")


@pytest.mark.usefixtures("no_gl")
def test_a_window_shows_reset_and_each_step(monkeypatch):
    shown = []
    monkeypatch.setattr("palpate.envs.pictures.episode_view.SIZE", (80, 60))
    monkeypatch.setattr(window, "toolkit_name", lambda: "toy")
    monkeypatch.setattr(window.Window, "show", lambda _, picture: shown.append(picture))
    env = ProbeEnv(("simple-hand",), render_mode="human")
    env.reset(seed=0)
    env.step(ACTION)
    assert env.render() is None
    assert [picture.shape for picture in shown] == [(60, 80, 3)] * 2
    assert not np.array_equal(*shown)
    env.close()


def test_gymnasium_records_a_video_of_it(tmp_path):
    pytest.importorskip("moviepy")
    made = gymnasium.make(IDS[0], library=("simple-hand",), max_probes=2, render_mode="rgb_array")
    with gymnasium.wrappers.RecordVideo(
        made, str(tmp_path / "films"), disable_logger=True
    ) as recorded:
        recorded.reset(seed=0)
        recorded.step(ACTION)
        recorded.step(ACTION)
    assert [path.suffix for path in (tmp_path / "films").iterdir()] == [".mp4"]


def test_gymnasium_shows_it_in_a_window_of_its_own(monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    made = gymnasium.make(IDS[0], library=("simple-hand",), max_probes=2, render_mode="rgb_array")
    shown = gymnasium.wrappers.HumanRendering(made)
    shown.reset(seed=0)
    shown.step(ACTION)
    shown.close()
