"""Pictures: two renderers that know nothing of each other show the same scene at the same place."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from palpate.envs.pictures import renderer
from palpate.envs.pictures import view as picture_view
from palpate.envs.pictures.marks import sharp_edges
from palpate.envs.pictures.picture import draw, renderer_note
from palpate.envs.pictures.picture_scene import Ghost, PictureScene, Tip
from palpate.envs.pictures.renderer import Renderer
from palpate.envs.pictures.view import Stage

SIZE = 400, 300


def l_prism():
    """An L-shaped prism, 6 and 3 cm long and 2 cm thick; vertices and outward triangles."""
    outline = np.array([(0, 0), (6, 0), (6, 2), (2, 2), (2, 5), (0, 5)]) / 100
    bottom, top = (np.column_stack([outline, np.full(6, z)]) for z in (-0.01, 0.01))
    lid = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    walls = [
        wall
        for i, j in zip(range(6), [1, 2, 3, 4, 5, 0], strict=True)
        for wall in ((i, j, j + 6), (i, j + 6, i + 6))
    ]
    triangles = [(a, c, b) for a, b, c in lid] + [(a + 6, b + 6, c + 6) for a, b, c in lid] + walls
    return np.concatenate([bottom, top]), np.array(triangles)


@pytest.fixture
def scene() -> PictureScene:
    return l_scene()


def l_scene() -> PictureScene:
    vertices, triangles = l_prism()
    contacts = np.array([(0.04, 0.01, 0.01), (0.01, 0.035, 0.01)])
    upward = np.array([(0.0, 0.0, 1.0)] * 2)
    rays = [(c + (0.02 * i, 0, 0.5), c) for i, c in enumerate(contacts)]
    return PictureScene(
        object_vertices_world=vertices,
        object_triangles=triangles,
        object_edges_world=sharp_edges(vertices, triangles),
        rays_world=np.array([*rays, ((0.08, 0.05, 0.5), (0.08, 0.05, 0.0))]),
        ray_hits=np.array([True, True, False]),
        contacts_world=contacts,
        normals_world=upward,
        ghosts=(Ghost(vertices + (0.03, 0.01, 0.005), triangles, "a rival"),),
        title="an L",
        subtitle="touched twice",
    )


def pixels(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(float) / 255


def near(image, colour, tolerance=0.12):
    """Where ``image`` has about ``colour``."""
    return np.abs(image - colour).max(axis=-1) < tolerance


def contact_is_painted(image, scene, contact):
    view = picture_view.frame(scene, SIZE)
    x, y = np.round(view.project(contact, SIZE)[:2]).astype(int)
    return near(image[y - 2 : y + 3, x - 2 : x + 3], picture_view.CONTACT, 0.25).any()


@pytest.fixture
def no_gl(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")


@pytest.mark.usefixtures("no_gl")
def test_without_gl_numpy_draws_and_says_so(scene, tmp_path):
    path = tmp_path / "out.png"
    painter = draw(scene, path, SIZE)
    assert painter == "NumPy"
    assert "NumPy" in renderer_note(painter)
    assert [p.name for p in tmp_path.iterdir()] == ["out.png"]
    image = pixels(path)
    assert image.shape == (SIZE[1], SIZE[0], 3)
    assert near(image, picture_view.OBJECT, 0.2).mean() > 0.03
    assert near(image, picture_view.ghost_colours(scene)["a rival"]).any()
    assert all(contact_is_painted(image, scene, contact) for contact in scene.contacts_world)


def test_with_gl_both_renderers_draw_the_same_scene(scene, tmp_path, monkeypatch):
    painter = draw(scene, tmp_path / "gl.png", SIZE)
    if painter != "MuJoCo":
        pytest.skip("no GL library here")
    assert renderer_note(painter) == ""
    by_gl = pixels(tmp_path / "gl.png")
    assert by_gl.shape == (SIZE[1], SIZE[0], 3)
    assert all(contact_is_painted(by_gl, scene, contact) for contact in scene.contacts_world)

    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    assert draw(scene, tmp_path / "plot.png", SIZE) == "NumPy"
    by_plot = pixels(tmp_path / "plot.png")
    assert np.abs(by_gl - by_plot).mean() < 0.06
    assert np.abs(by_gl - by_plot[:, ::-1]).mean() > 0.06, "a mirror image should have failed"


def test_a_renderer_that_hangs_is_given_up(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(renderer, "GL_SECONDS", 0.01)
    assert draw(scene, tmp_path / "out.png", SIZE) == "NumPy"


@pytest.mark.usefixtures("no_gl")
def test_what_the_object_hides_is_not_painted(scene, tmp_path):
    below = np.array([(0.04, 0.01, -0.01)])
    hidden = replace(
        scene, contacts_world=below, normals_world=[(0, 0, -1.0)], rays_world=[], ray_hits=[]
    )
    draw(hidden, tmp_path / "out.png", SIZE)
    assert not contact_is_painted(pixels(tmp_path / "out.png"), hidden, below[0])


@pytest.mark.usefixtures("no_gl")
def test_a_bare_object_can_be_drawn(scene, tmp_path):
    nothing = {"object_edges_world": [], "rays_world": [], "ray_hits": []}
    bare = replace(scene, **nothing, contacts_world=[], normals_world=[], ghosts=(), title="")
    draw(bare, tmp_path / "out.png", SIZE)
    assert near(pixels(tmp_path / "out.png"), picture_view.OBJECT, 0.2).mean() > 0.03


@pytest.mark.usefixtures("no_gl")
def test_a_failed_write_leaves_the_old_picture_and_nothing_else(scene, tmp_path, monkeypatch):
    def save_half(_, path, **__):
        path.write_bytes(b"half a picture")
        raise OSError("disk full")

    path = tmp_path / "out.png"
    path.write_bytes(b"the old picture")
    monkeypatch.setattr(Image.Image, "save", save_half)
    with pytest.raises(OSError, match="disk full"):
        draw(scene, path, SIZE)
    assert path.read_bytes() == b"the old picture"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("name", "complaint"), [("out.jpg", "should end in .png"), ("none/out.png", "does not exist")]
)
def test_a_path_that_cannot_be_drawn_to_is_named(name, complaint, scene, tmp_path):
    with pytest.raises(ValueError, match=complaint):
        draw(scene, tmp_path / name, SIZE)


def test_arrays_that_do_not_fit_are_named(scene):
    with pytest.raises(ValueError, match=r"rays_world has shape \(2, 3\)"):
        replace(scene, rays_world=np.zeros((2, 3)))
    with pytest.raises(ValueError, match="contacts_world has 2 rows but normals_world has 1"):
        replace(scene, normals_world=scene.normals_world[:1])
    with pytest.raises(ValueError, match="nothing to draw"):
        replace(scene, object_vertices_world=[])


def painted(painter, scene, stage):
    return painter.draw(scene, stage, SIZE).astype(float) / 255


@pytest.fixture(scope="module", params=["MuJoCo", "NumPy"])
def painter(request):
    """A renderer of either kind."""
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "NumPy":
            patch.setenv("MUJOCO_GL", "nonsense")
        made = Renderer()
        made.draw(l_scene(), Stage.of(l_scene(), SIZE), SIZE)
    if made.name != request.param:
        pytest.skip("no GL library here")
    yield made
    made.close()


def test_a_ghost_fades_until_it_is_gone(painter, scene):
    stage = Stage.of(scene, SIZE)
    bare = painted(painter, replace(scene, ghosts=()), stage)

    def weight(opacity):
        ghosts = (replace(scene.ghosts[0], opacity=opacity),)
        return np.abs(painted(painter, replace(scene, ghosts=ghosts), stage) - bare).sum()

    whole, half, none = weight(1.0), weight(0.5), weight(0.0)
    assert whole > 1.2 * half > 0.0
    assert none < 0.01 * whole


def test_a_ghost_keeps_the_colour_that_it_was_given(painter, scene):
    stage = Stage.of(scene, SIZE)
    (ghost,) = scene.ghosts
    green = painted(painter, replace(scene, ghosts=(replace(ghost, colour=2),)), stage)
    assert near(green, picture_view.GHOSTS[2]).any()
    assert not near(green, picture_view.GHOSTS[0]).any()


@pytest.mark.parametrize("radius", [0.0, 0.004])
def test_a_tip_under_way_is_seen_where_it_is(painter, scene, radius):
    stage = Stage.of(scene, SIZE)
    path = np.array([(0.02, 0.03, 0.06), (0.03, 0.02, 0.025)])
    alone = replace(scene, ghosts=(), rays_world=[], ray_hits=[])
    x, y = np.round(stage.view.project(path[1], SIZE)[:2]).astype(int)
    around = np.s_[y - 2 : y + 3, x - 2 : x + 3]
    with_tip = painted(painter, replace(alone, tips=(Tip(path, radius),)), stage)[around]
    assert near(with_tip, picture_view.RAY_HIT, 0.25).any()
    assert not near(painted(painter, alone, stage)[around], picture_view.RAY_HIT, 0.25).any()


def test_a_normal_of_no_length_has_no_arrow(painter, scene):
    stage = Stage.of(scene, SIZE)
    counts = [
        near(
            painted(painter, replace(scene, normals_world=length * scene.normals_world), stage),
            picture_view.CONTACT,
        ).sum()
        for length in (0.0, 0.5, 1.0)
    ]
    assert 0 < counts[0] < counts[1] < counts[2]


def test_one_process_draws_all_pictures_and_ends_when_told(scene):
    stage = Stage.of(scene, SIZE)
    with Renderer() as painter:
        first = painter.draw(scene, stage, SIZE)
        if painter.name != "MuJoCo":
            pytest.skip("no GL library here")
        process = painter._process
        assert process is not None
        moved = replace(scene, object_vertices_world=scene.object_vertices_world + (0.01, 0, 0))
        assert not np.array_equal(painter.draw(moved, stage, SIZE), first)
        assert np.array_equal(painter.draw(scene, stage, SIZE), first)
        assert painter._process is process
        copy = pickle.loads(pickle.dumps(painter))
        assert copy._process is None, "a copy has a process of its own"
    assert painter._process is None
    assert not process.end.alive
    assert np.array_equal(painter.draw(scene, stage, SIZE), first), "it starts again when needed"
    painter.close()
    painter.close()


def test_a_process_that_dies_on_the_way_is_made_up_for(scene):
    stage = Stage.of(scene, SIZE)
    with Renderer() as painter:
        painter.draw(scene, stage, SIZE)
        if painter.name != "MuJoCo":
            pytest.skip("no GL library here")
        painter._untried.clear()
        assert painter._process is not None
        painter._process.end()
        assert painter.draw(scene, stage, SIZE).shape == (SIZE[1], SIZE[0], 3)
        assert painter.name == "NumPy"


@pytest.mark.parametrize("shared", [True, False], ids=["shared vertices", "loose triangles"])
def test_the_edges_of_an_l_prism_are_its_eighteen(shared):
    vertices, triangles = l_prism()
    if not shared:
        vertices, triangles = vertices[triangles].reshape(-1, 3), np.arange(60).reshape(20, 3)
    edges = sharp_edges(vertices, triangles)
    assert len(edges) == 18
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(2 * 0.22 + 6 * 0.02)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_object_and_contacts_are_always_inside_the_picture(scale, scene):
    rng = np.random.default_rng(1)
    for _ in range(20):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        moved = replace(
            scene,
            object_vertices_world=scale * (scene.object_vertices_world @ turn + rng.normal(size=3)),
            contacts_world=[],
            normals_world=[],
            ghosts=(),
        )
        view = picture_view.frame(moved, SIZE)
        x, y, depth = view.project(moved.object_vertices_world, SIZE).T
        assert 0 < x.min() < x.max() < SIZE[0]
        assert 0 < y.min() < y.max() < SIZE[1]
        assert depth.min() > 0
        assert max(np.ptp(x) / SIZE[0], np.ptp(y) / SIZE[1]) > 0.5
