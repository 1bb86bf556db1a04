"""Meshes: what a B-spline promises, its inverse, other sizes, the project file, and cameras that have one."""

import json
from dataclasses import replace

import numpy as np
import pytest

from panostitch.model.alignment import camera_from_json
from panostitch.model.mesh import STEEPEST, Mesh, flat_mesh, mesh_from_json
from panostitch.synthetic.scene import rig
from tolerances import PIXEL

SIZE = (400, 300)


def wavy(size=SIZE, *, steepness=STEEPEST, seed=3):
    """A mesh of random displacements, as steep as asked."""
    mesh = flat_mesh(size)
    mesh = Mesh(size, np.random.default_rng(seed).normal(0, 1, mesh.nodes.shape))
    return Mesh(size, mesh.nodes * (steepness / mesh.steepness))


def places(size=SIZE, count=500):
    """Pixels (n, 2), some of them beyond the edges."""
    return np.random.default_rng(1).uniform(-30, np.array(size) + 30, (count, 2))


def test_cells_are_nearly_square():
    assert flat_mesh((1200, 800)).cells == (24, 16)
    assert flat_mesh((800, 1200), 12).cells == (8, 12)
    assert flat_mesh((1000, 3)).cells == (24, 1)


def test_equal_nodes_shift_every_pixel_alike():
    mesh = Mesh(SIZE, np.full(flat_mesh(SIZE).nodes.shape, 2.5))

    np.testing.assert_allclose(mesh.displacement(places()), 2.5, atol=PIXEL)


def test_nodes_on_a_slope_make_a_slope():
    mesh = flat_mesh(SIZE)
    columns, _ = mesh.cells
    slope = 0.1 * (np.arange(mesh.nodes.shape[1]) - 1)[:, None] + np.zeros_like(mesh.nodes)
    xy = places()[(places() >= 0).all(1) & (places() <= np.array(SIZE) - 1).all(1)]

    moved = Mesh(SIZE, slope).displacement(xy)

    np.testing.assert_allclose(moved, np.repeat(0.1 * (xy[:, :1] + 0.5) / SIZE[0] * columns, 2, axis=1), atol=PIXEL)


def test_terms_are_what_displaces():
    mesh, xy = wavy(), places()

    numbers, weights = mesh.terms(xy)

    summed = (weights[..., None] * mesh.nodes.reshape(-1, 2)[numbers]).sum(0)
    np.testing.assert_allclose(mesh.displacement(xy), summed, atol=PIXEL)


def test_no_displacement_is_larger_or_steeper_than_is_said():
    mesh, xy = wavy(), places(count=20_000)
    step = np.array([0.01, 0.0])

    assert np.linalg.norm(mesh.displacement(xy), axis=1).max() <= mesh.largest
    change = np.linalg.norm(mesh.displacement(xy + step) - mesh.displacement(xy), axis=1).max() / step[0]
    assert 0.2 * mesh.steepness < change <= mesh.steepness


def test_straightened_is_the_inverse_of_bent():
    mesh, xy = wavy(), places()

    assert np.abs(mesh.displacement(xy)).max() > 0.5  # px: there is something to undo
    np.testing.assert_allclose(mesh.straightened(mesh.bent(xy)), xy, atol=PIXEL)


def test_what_is_not_seen_stays_unseen():
    assert np.isnan(wavy().bent(np.array([[np.nan, np.nan]]))).all()


def test_camera_with_a_mesh_goes_there_and_back():
    (camera,) = rig([0.3], size=SIZE, focal=430.0, k1=-0.1)
    bent = replace(camera, mesh=wavy())
    xy = places()

    np.testing.assert_allclose(bent.project(bent.rays(xy)), xy, atol=PIXEL)
    assert np.abs(bent.project(camera.rays(xy)) - xy).max() > 0.5


def test_camera_with_a_mesh_at_half_the_size():
    (camera,) = rig([0.3], size=SIZE, focal=430.0)
    bent = replace(camera, mesh=wavy())
    rays = camera.rays(places())

    small = bent.scaled((200, 150)).project(rays)

    np.testing.assert_allclose((small + 0.5) * 2 - 0.5, bent.project(rays), atol=PIXEL)


def test_comes_back_from_text_to_the_last_bit():
    mesh = wavy()

    back = mesh_from_json(json.loads(json.dumps(mesh.nodes.tolist())), SIZE)

    np.testing.assert_array_equal(back.nodes, mesh.nodes)


@pytest.mark.parametrize(
    "nodes",
    [
        [],
        [[1.0, 2.0]],
        np.zeros((3, 9, 2)).tolist(),
        np.zeros((9, 9, 3)).tolist(),
        np.full((5, 5, 2), np.nan).tolist(),
        wavy(steepness=1.5).nodes.tolist(),
        "mesh",
    ],
)
def test_nonsense_is_refused(nodes):
    (camera,) = rig([0.3], size=SIZE, focal=430.0)
    entry = {
        "size": SIZE, "focal": 1.0, "centre": (0, 0), "k1": 0, "k2": 0,
        "cam_from_world": camera.cam_from_world.tolist(), "mesh": nodes,
    }  # fmt: skip
    with pytest.raises((TypeError, ValueError)):
        camera_from_json(entry)
