"""Pictures of the planar environment, and the window that they are shown in."""

from __future__ import annotations

import pickle

import gymnasium
import numpy as np
import pytest

import palpate.envs
from palpate.envs.pictures import view as picture_view
from palpate.envs.pictures import window
from palpate.envs.planar.picture import PlanarPicture, draw_planar
from palpate.envs.planar.planar_env import PlanarProbeEnv

gymnasium.register_envs(palpate.envs)

ID = "palpate/ProbePlanar-v0"


def test_a_picture_shows_each_thing_where_it_is():
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    image = draw_planar(
        PlanarPicture(
            outline_world=square,
            rays_world=np.array([[[-9.0, 0.0], [-1.0, 0.0]], [[-9.0, 1.8], [9.0, 1.8]]]),
            ray_hits=np.array([True, False]),
            contacts_world=np.array([[-1.0, 0.0]]),
            normals_world=np.array([[-1.0, 0.0]]),
            ghosts=(),
            half_width=2.0,
            title="",
        ),
        size=400,
    )
    assert image.shape == (400, 400, 3)
    assert image.dtype == np.uint8

    def colour_at(x, y):
        # The axes fill 0.96 x 0.90 of the picture from 0.02; the world is square in their middle.
        side = 0.90 * 400 / (2.0 * 2.0 * 1.1)
        return image[round(400 - (0.47 * 400 + y * side)), round(200 + x * side)] / 255.0

    assert colour_at(0.5, 0.5) == pytest.approx(picture_view.OBJECT, abs=0.02)
    assert colour_at(-1.0, 0.0) == pytest.approx(picture_view.CONTACT, abs=0.05)
    assert colour_at(-1.6, 0.0) == pytest.approx(picture_view.RAY_HIT, abs=0.4)
    assert colour_at(0.0, 1.8) == pytest.approx(picture_view.RAY_MISSED, abs=0.3)
    assert colour_at(1.5, 1.5) == pytest.approx([1.0, 1.0, 1.0])


def test_rendering_follows_the_episode_and_is_the_same_to_the_bit():
    env, other = (PlanarProbeEnv(render_mode="rgb_array") for _ in range(2))
    frames = []
    for each in (env, other):
        each.reset(seed=1)
        frames.append([each.render()])
        for action in ([0.2, 0.0], [0.7, 0.1]):
            each.step(np.array(action))
            frames[-1].append(each.render())
    assert all(np.array_equal(a, b) for a, b in zip(*frames, strict=True))
    assert len({frame.tobytes() for frame in frames[0]}) == 3
    assert frames[0][0].shape == (600, 600, 3)
    assert PlanarProbeEnv().render() is None


def test_a_window_where_none_can_open_is_refused_with_a_word_on_what_would_do(monkeypatch):
    monkeypatch.setattr(window, "toolkit_name", lambda: None)
    with pytest.raises(gymnasium.error.DependencyNotInstalled, match="rgb_array"):
        gymnasium.make(ID, render_mode="human")


def test_matplotlibs_picture_backend_opens_no_windows():
    import matplotlib.pyplot as plt

    plt.switch_backend("agg")
    assert window.toolkit_name() is None


def test_a_window_shows_each_step_until_it_is_closed(monkeypatch):
    """On a toolkit that only counts: matplotlib's figures are real, opening them isn't."""
    import matplotlib.pyplot as plt
    from matplotlib.figure import Figure

    plt.switch_backend("agg")
    opened = []
    monkeypatch.setattr(window, "toolkit_name", lambda: "counting")
    monkeypatch.setattr(Figure, "show", lambda figure: opened.append(figure))
    env = gymnasium.make(ID, render_mode="human").unwrapped
    assert isinstance(env, PlanarProbeEnv)
    env.reset(seed=0)
    env.step(np.array([0.3, 0.0]))
    assert env.render() is None
    (figure,) = opened
    shown = np.asarray(figure.axes[0].images[0].get_array())
    env.render_mode = "rgb_array"
    drawn = env.render()
    assert drawn is not None
    assert np.array_equal(shown, drawn)
    env.render_mode = "human"
    plt.close(figure)
    env.step(np.array([0.3, 0.0]))
    assert len(opened) == 2
    copy = pickle.loads(pickle.dumps(env))
    copy.step(np.array([0.3, 0.0]))
    copy.close()
    env.close()
    env.close()
    assert not plt.get_fignums()
