"""The film of an episode: the file that comes out, and what its pictures show."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest

from palpate.envs.pictures import episode_film
from palpate.envs.pictures import view as picture_view
from palpate.envs.pictures.episode import Episode
from palpate.envs.pictures.episode_film import film_episode
from palpate.envs.pictures.episode_picture import likeness_of
from palpate.envs.pictures.film_approach import FEW_RAYS, approach
from palpate.envs.pictures.film_script import (
    ENDING,
    FRAME_RATE,
    LONGEST,
    OPENING,
    EpisodeRecord,
    FilmScript,
)
from palpate.envs.pictures.rivals import leading_rivals
from palpate.envs.pictures.video import Video, check_video_path
from palpate.envs.probe_env import ProbeEnv
from palpate.envs.scene.scene import OBJECT

SIZE = 320, 240


def record_of(**arguments) -> EpisodeRecord:
    env = ProbeEnv(object_name="complex-hand", **arguments)
    _, info = env.reset(seed=45)
    start = Episode.of(env, info)
    rng = np.random.default_rng(np.random.SeedSequence(45).spawn(1)[0])
    probes = []
    for _ in range(2):
        *_, info = env.step(rng.uniform(-1.0, 1.0, 3).astype(np.float32))
        probes.append(Episode.of(env, info))
    return EpisodeRecord(start, tuple(probes), ("It is complex-hand", "2 probes"))


@pytest.fixture(scope="module")
def record() -> EpisodeRecord:
    """Two probes: the first leaves about a hundred hypotheses, the second one."""
    made = record_of()
    first, second = (len(probed.belief) for probed in made.probes if probed.belief)
    assert 50 < first < 200
    assert second == 1
    return made


@pytest.fixture(scope="module")
def shots(record):
    return list(FilmScript(record, SIZE).shots())


def frames_of(path: Path):
    with av.open(str(path)) as file:
        stream = file.streams.video[0]
        context = stream.codec_context
        assert (context.name, context.pix_fmt) == ("h264", "yuv420p")
        assert stream.average_rate == FRAME_RATE
        return [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]


def near(image, colour, tolerance=0.1):
    return np.abs(image / 255 - np.array(colour)).max(axis=-1) < tolerance


def test_the_film_is_a_file_that_plays_as_the_script_says(record, tmp_path, monkeypatch):
    monkeypatch.setattr(episode_film, "SLOW_EVERY", 10)
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    told = []
    film = film_episode(record, tmp_path / "a.mp4", SIZE, lambda *each: told.append(each))
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]
    assert film.renderer == "NumPy"
    frames = frames_of(tmp_path / "a.mp4")
    shots = list(FilmScript(record, SIZE, 10).shots())
    assert told == [(drawn, len(shots)) for drawn in range(1, len(shots) + 1)]
    assert len(frames) == sum(shot.frames for shot in shots) == round(film.seconds * FRAME_RATE)
    assert {frame.shape for frame in frames} == {(SIZE[1], SIZE[0], 3)}

    starts = np.cumsum([0] + [shot.frames for shot in shots[:-1]])
    seen = [frames[start] for start in starts]
    changes = [np.abs(a.astype(int) - b).max() > 30 for a, b in pairwise(seen)]
    # A tip that leaves was hidden by the contact that it felt.
    leaves = [bool(a.scene.tips and not b.scene.tips) for a, b in pairwise(shots)]
    assert all(np.logical_or(changes, leaves))
    assert sum(leaves) == len(record.probes)
    still = round(OPENING * FRAME_RATE)
    assert np.abs(frames[0].astype(int) - frames[still - 1]).mean() < 1
    # Rivals are in the picture between the probes, and are gone at the end.
    rivals = [sum(near(frame, ghost).sum() for ghost in picture_view.GHOSTS[:3]) for frame in seen]
    assert rivals[0] == rivals[-1] == 0
    assert max(rivals) > 30


def test_with_gl_every_picture_is_a_new_one(record, tmp_path):
    short = replace(record, probes=record.probes[:1])
    film = film_episode(short, tmp_path / "a.mp4", (160, 120))
    if film.renderer != "MuJoCo":
        pytest.skip("no GL library here")
    shots = list(FilmScript(short, (160, 120)).shots())
    assert len(frames_of(tmp_path / "a.mp4")) == sum(shot.frames for shot in shots)
    assert [shot.frames for shot in shots[1:-2]] == [1] * (len(shots) - 3)


def test_the_film_opens_and_ends_still(shots, record):
    first, last = shots[0], shots[-1]
    assert not len(first.scene.contacts_world)
    assert not first.scene.ghosts
    assert first.frames == round(OPENING * FRAME_RATE)
    assert (last.caption.title, last.caption.subtitle) == record.verdict
    assert np.array_equal(last.scene.contacts_world, record.probes[-1].contacts.positions)
    assert last.frames == round(ENDING * FRAME_RATE) >= 2 * FRAME_RATE


def test_tips_go_along_their_rays_to_where_these_ended(shots, record):
    tips = [shot.scene.tips[0].path_world[1] for shot in shots if shot.scene.tips]
    ends = np.concatenate([touch.ends_world for touch in record.probes[-1].touches])
    starts = np.concatenate([touch.starts_world for touch in record.probes[-1].touches])
    for start, end in zip(starts, ends, strict=True):
        along = (end - start) / np.linalg.norm(end - start)
        on_ray = [tip for tip in tips if np.linalg.norm(np.cross(tip - end, along)) < 1e-9]
        depths = [float((tip - end) @ along) for tip in on_ray]
        assert depths == sorted(depths)
        assert depths[0] < -0.01
        assert depths[-1] == pytest.approx(0.0, abs=1e-12)


def test_contacts_come_one_by_one_and_their_normals_grow(shots, record):
    counts = [len(shot.scene.contacts_world) for shot in shots]
    assert counts == sorted(counts)
    assert set(counts) == set(range(len(record.probes[-1].contacts) + 1))
    for count in set(counts) - {0}:
        lengths = [
            np.linalg.norm(shot.scene.normals_world[count - 1])
            for shot in shots
            if len(shot.scene.contacts_world) == count
        ]
        assert lengths == sorted(lengths)
        assert lengths[0] < 0.6
        assert lengths[-1] == pytest.approx(1.0)


def test_rivals_that_a_probe_rules_out_fade_and_stay_away(shots, record):
    start, after = record.start, record.probes[0]
    truth = start.true_object.name, start.T_world_object
    likeness = likeness_of(after)
    leaders = leading_rivals(after.belief, likeness, truth, 3)
    assert len({rival.object_name for rival in leaders}) == 3
    most = max(shots, key=lambda shot: sum(ghost.opacity for ghost in shot.scene.ghosts))
    assert len(most.scene.ghosts) == 3
    for ghost, rival in zip(most.scene.ghosts, leaders, strict=True):
        vertices = rival.pose.apply(likeness.library[rival.object_name].vertices)
        assert np.allclose(ghost.vertices_world, vertices)
    shown = [[ghost.opacity for ghost in shot.scene.ghosts if ghost.colour == 0] for shot in shots]
    opacities = [opacity[0] if opacity else 0.0 for opacity in shown]
    peak = [row for row, opacity in enumerate(opacities) if opacity == 1.0]
    assert opacities[: peak[0]] == sorted(opacities[: peak[0]])
    assert opacities[peak[-1] :] == sorted(opacities[peak[-1] :], reverse=True)
    assert opacities[-1] == 0.0
    names = [text for shot in shots for _, text in shot.caption.legend[0]]
    assert f"maybe {leaders[0].object_name}" in names
    assert f"ruled out: {leaders[0].object_name}" in names


def test_captions_tell_what_is_left(record, shots):
    told = list(dict.fromkeys((shot.caption.title, shot.caption.subtitle) for shot in shots))
    assert [title for title, _ in told[1:-1]] == ["Probe 1 of 2"] * 2 + ["Probe 2 of 2"] * 2
    assert told[1][1] == "Nothing touched yet"
    left = len(record.probes[0].belief)
    assert told[2][1].startswith(f"{left} hypotheses left: ")
    assert told[2][1] == told[3][1]
    assert told[4][1].startswith("1 hypothesis left: complex-hand")


def test_a_long_episode_is_shown_faster(record):
    long = replace(record, probes=record.probes * 20)
    seconds = sum(shot.frames for shot in FilmScript(long, SIZE).shots()) / FRAME_RATE
    assert LONGEST / 2 < seconds < 60


def test_the_camera_stays_and_sees_an_object_that_is_moved(record):
    model, pose = record.start.true_object, record.start.T_world_object
    shift = np.array([0.5 * model.diameter, 0.0, 0.0])
    moved = type(pose).from_components(pose.translation + shift, pose.rotation)
    probes = (record.probes[0], replace(record.probes[1], T_world_object=moved))
    script = FilmScript(replace(record, probes=probes), SIZE)
    shots = list(script.shots())
    for shot, shown in ((shots[0], pose), (shots[-1], moved)):
        assert np.allclose(shot.scene.object_vertices_world, shown.apply(model.vertices))
        assert script.stage.holds(shot.scene.object_vertices_world, SIZE)


@pytest.mark.parametrize("sensor", ["ball", "range", "range-grid"])
@pytest.mark.parametrize("placement", ["across", "resting"])
def test_every_sensor_and_placement_has_a_film(sensor, placement):
    env = ProbeEnv(("simple-hand",), sensor=sensor, placement=placement, max_probes=1)
    _, info = env.reset(seed=1)
    start = Episode.of(env, info)
    *_, info = env.step(np.zeros(3))
    record = EpisodeRecord(start, (Episode.of(env, info),), ("", ""))
    shots = list(FilmScript(record, SIZE).shots())
    tips = [shot.scene.tips for shot in shots if shot.scene.tips]
    rays = len(env.touches[-1].outcomes)
    assert {len(each) for each in tips} == {1 if rays <= FEW_RAYS else rays}
    assert {tip.radius for each in tips for tip in each} == {0.002 if sensor == "ball" else 0.0}
    assert len(shots[-2].scene.contacts_world) == (env.touches[-1].outcomes == OBJECT).sum()


def test_an_episode_without_a_contact_has_a_film(record):
    (touch,), nothing = record.probes[0].touches, record.start.contacts
    missed = replace(touch, contacts=nothing, outcomes=np.full(3, 2, np.int8))
    after = replace(record.start, touches=(missed,))
    shots = list(FilmScript(replace(record, probes=(after,)), SIZE).shots())
    assert not shots[-2].scene.ray_hits.any()
    assert len(shots[-2].scene.rays_world) == 3
    assert not len(shots[-1].scene.contacts_world)


def test_contacts_that_no_ray_tells_of_come_last(record):
    touch = replace(record.probes[0].touches[0], outcomes=np.full(3, 2, np.int8))
    moments = list(approach(touch, 0.1, lambda seconds: round(10 * seconds)))
    assert [moment.growth.all() for moment in moments[-2:]] == [True, True]
    assert not any(moment.growth.any() for moment in moments[:10])


def test_a_film_that_fails_leaves_the_old_one_and_nothing_else(tmp_path):
    path = tmp_path / "a.mp4"
    path.write_bytes(b"the old film")
    with pytest.raises(ValueError, match="ndim"), Video(path, SIZE, FRAME_RATE) as video:
        video.add(np.zeros((SIZE[1], 3), np.uint8))
    assert path.read_bytes() == b"the old film"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("name", "complaint"), [("a.avi", "should end in .mp4"), ("none/a.mp4", "does not exist")]
)
def test_a_path_that_cannot_be_filmed_to_is_named(name, complaint, tmp_path):
    with pytest.raises(ValueError, match=complaint):
        check_video_path(tmp_path / name)


def test_a_film_of_odd_size_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"even, not \(321, 240\)"):
        Video(tmp_path / "a.mp4", (321, 240), FRAME_RATE)


def test_colours_are_those_that_the_film_says_it_has(tmp_path):
    red, green, blue = picture_view.CONTACT
    picture = np.empty((64, 64, 3), np.uint8)
    picture[:] = np.round(255 * np.array([red, green, blue]))
    with Video(tmp_path / "a.mp4", (64, 64), FRAME_RATE) as video:
        video.add(picture, 3)
    with av.open(str(tmp_path / "a.mp4")) as file:
        frames = list(file.decode(video=0))
    assert len(frames) == 3
    luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue  # ITU-R BT.709
    expected = 16 + 219 * luma, 128 + 224 * (blue - luma) / 1.8556
    planes = frames[-1].to_ndarray(format="yuv420p")
    assert (planes[0, 0], planes[64, 0]) == pytest.approx(expected, abs=1.5)
    assert frames[-1].colorspace == 1, "BT.709"
