"""Pictures: two renderers that know nothing of each other show the same scene at the same place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from palpate.envs import picture, picture_view
from palpate.envs.picture import Ghost, PictureScene, draw, renderer_note

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
    vertices, triangles = l_prism()
    contacts = np.array([(0.04, 0.01, 0.01), (0.01, 0.035, 0.01)])
    upward = np.array([(0.0, 0.0, 1.0)] * 2)
    rays = [(c + (0.02 * i, 0, 0.5), c) for i, c in enumerate(contacts)]
    return PictureScene(
        object_vertices_world=vertices,
        object_triangles=triangles,
        object_edges_world=picture_view.sharp_edges(vertices, triangles),
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
def test_without_gl_matplotlib_draws_and_says_so(scene, tmp_path):
    path = tmp_path / "out.png"
    renderer = draw(scene, path, SIZE)
    assert renderer == "matplotlib"
    assert "matplotlib" in renderer_note(renderer)
    assert [p.name for p in tmp_path.iterdir()] == ["out.png"]
    image = pixels(path)
    assert image.shape == (SIZE[1], SIZE[0], 3)
    assert near(image, picture_view.OBJECT, 0.2).mean() > 0.03
    assert near(image, picture_view.ghost_colours(scene)["a rival"]).any()
    assert all(contact_is_painted(image, scene, contact) for contact in scene.contacts_world)


def test_with_gl_both_renderers_draw_the_same_scene(scene, tmp_path, monkeypatch):
    renderer = draw(scene, tmp_path / "gl.png", SIZE)
    if renderer != "MuJoCo":
        pytest.skip("no GL library here")
    assert renderer_note(renderer) == ""
    by_gl = pixels(tmp_path / "gl.png")
    assert by_gl.shape == (SIZE[1], SIZE[0], 3)
    assert all(contact_is_painted(by_gl, scene, contact) for contact in scene.contacts_world)

    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    assert draw(scene, tmp_path / "plot.png", SIZE) == "matplotlib"
    by_plot = pixels(tmp_path / "plot.png")
    assert np.abs(by_gl - by_plot).mean() < 0.06
    assert np.abs(by_gl - by_plot[:, ::-1]).mean() > 0.06, "a mirror image should have failed"


def test_a_renderer_that_hangs_is_given_up(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(picture, "GL_SECONDS", 0.01)
    assert draw(scene, tmp_path / "out.png", SIZE) == "matplotlib"


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


def test_a_scene_survives_its_file(scene, tmp_path):
    picture.save_scene(scene, tmp_path / "scene.npz")
    again = picture.load_scene(tmp_path / "scene.npz")
    assert (again.title, again.plane_height, again.ghosts[0].label) == ("an L", 0.0, "a rival")
    assert np.array_equal(again.rays_world, scene.rays_world)
    assert np.array_equal(again.ghosts[0].vertices_world, scene.ghosts[0].vertices_world)


@pytest.mark.parametrize("shared", [True, False], ids=["shared vertices", "loose triangles"])
def test_the_edges_of_an_l_prism_are_its_eighteen(shared):
    vertices, triangles = l_prism()
    if not shared:
        vertices, triangles = vertices[triangles].reshape(-1, 3), np.arange(60).reshape(20, 3)
    edges = picture_view.sharp_edges(vertices, triangles)
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
