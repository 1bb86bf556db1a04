"""Meshes: known parallax is recovered, and nothing is bent without evidence."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from panostitch import alignment, pipeline
from panostitch.alignment import elastic_system
from panostitch.alignment.elastic import agreeing, relative_shift
from panostitch.alignment.elastic_system import LARGEST, errors, with_meshes
from panostitch.model.match import ControlPoints
from panostitch.model.mesh import CELLS, Mesh, flat_mesh
from panostitch.options import Options
from panostitch.runtime.executor import Executor
from panostitch.synthetic.render import photograph_plan
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene
from panostitch.synthetic.score import pair_errors

SIZE = (480, 360)
HFOV = np.deg2rad(50)
COARSE = 12  # cells, as many as the planted field needs
NO_LINES = [np.zeros((0, 3, 2))] * 2
PARALLAX = 6.0  # px, of the planted field where it is largest

# px, rms, of matches that were not fitted to, under a field that is as smooth as a mesh can follow: 0.04 seen.
RECOVERED = 0.15
# px, at the side of a photo that no match is near to, where the field would be 3 px: 0.53 seen.
FADED = 1.0
SAME = 1e-3  # px, of nodes: they are rounded to 1e-4, and sums in another order round otherwise. 0 seen.
CONVERGED = 0.05  # px, of nodes: 0.03 seen, 0.2 without the coarse grid
STRAIGHT = 0.1  # px by which a line of 300 px may leave its chord: nobody sees it. 0.02 seen, 0.3 without lines.
STEP = 3.0  # px, by which one wall is off and the one above it is not
FOLLOWED = 0.14  # px, median within 3 cells of where they meet: 0.09 seen, 0.2 with meshes three times as stiff
# Times by which meshes must lower the true error of cameras in a scene with parallax: 7 seen.
BETTER = 3.0
FAR = 40.0  # px, a twelfth of the photo, by which the lowest lines of two photos are off: patches are sought within 16
NEARER = 20.0  # times, by which meshes must lower that: 70 seen, 3 without flow


@cache
def pair():
    return rig([-0.2, 0.2], [0.02, -0.01], [0.01, 0.03], size=SIZE, hfov=HFOV)


def field(xy):
    """Displacement (n, 2) px of a scene whose depth comes and goes."""
    x, y = xy.T
    return PARALLAX * np.column_stack([np.sin(x / 80) * np.cos(y / 90), 0.3 * np.cos(x / 120)])


def matches(cameras, count, *, shift=field, seed=0, within=SIZE[0]):
    """Matches of a pair that are off by a field; of the first photo only pixels left of `within`."""
    xy = np.random.default_rng(seed).uniform(0, np.array(SIZE) - 1, (count, 2))
    there = cameras[1].project(cameras[0].rays(xy)) + shift(xy)
    seen = ((there >= 0) & (there <= np.array(SIZE) - 1)).all(1) & (xy[:, 0] < within)
    return ControlPoints(0, 1, xy[seen], there[seen])


def rms(cameras, points):
    return float(np.sqrt((errors(cameras, points) ** 2).sum(1).mean()))


def test_a_field_is_recovered_between_the_matches():
    bent = with_meshes(pair(), [matches(pair(), 1200)], NO_LINES, COARSE)

    unseen = matches(pair(), 500, seed=1)
    assert rms(pair(), unseen) > PARALLAX / 3
    assert rms(bent, unseen) < RECOVERED


def test_two_walls_are_followed_to_near_where_they_meet():
    """Depth that jumps: a mesh that is too stiff carries the jump far into either wall."""

    def walls(xy):
        return np.column_stack([STEP * (xy[:, 1] > SIZE[1] / 2), np.zeros(len(xy))])

    bent = with_meshes(pair(), [matches(pair(), 300, shift=walls)], NO_LINES)

    unseen = matches(pair(), 1500, shift=walls, seed=1)
    off = np.abs(unseen.xy_i[:, 1] - SIZE[1] / 2)
    near = unseen.take(off < 3 * SIZE[0] / CELLS)
    assert np.median(np.linalg.norm(errors(bent, near), axis=1)) < FOLLOWED


def test_both_photos_go_half_way():
    bent = with_meshes(pair(), [matches(pair(), 1200)], NO_LINES, COARSE)

    one, other = (camera.mesh.largest for camera in bent)
    assert 0.5 < one / other < 2.0


def test_meshes_shift_photos_against_each_other_where_they_lie_on_each_other():
    def shifted(nodes, other):
        meshes = [replace(flat_mesh(SIZE, COARSE), nodes=flat_mesh(SIZE, COARSE).nodes + n) for n in (nodes, other)]
        bent = [replace(camera, mesh=mesh) for camera, mesh in zip(pair(), meshes, strict=True)]
        return relative_shift(pair(), bent, matches(pair(), 10))

    left = np.zeros_like(flat_mesh(SIZE, COARSE).nodes)
    left[:, :4] = 10.0  # of the first photo, which the other one does not see
    assert shifted(0.0, 0.0) == 0
    assert shifted(left, 0.0) < 1e-6
    assert 9 < shifted(0.0, [10.0, 0.0]) < 11  # px
    assert shifted([10.0, 0.0], [10.0, 0.0]) < 3  # together


def test_the_order_of_the_photos_changes_nothing():
    points = matches(pair(), 1200)
    one = with_meshes(pair(), [points], NO_LINES, COARSE)
    other = with_meshes(pair()[::-1], [replace(points, i=1, j=0)], NO_LINES, COARSE)

    for here, there in zip(one, other[::-1], strict=True):
        np.testing.assert_allclose(here.mesh.nodes, there.mesh.nodes, atol=SAME)


def test_few_steps_solve_what_many_photos_do_together(monkeypatch):
    """Photos over one place, which may all go the same way at next to no cost."""
    cameras = rig([-0.1, -0.05, 0.0, 0.05, 0.1], [0.02, -0.01, 0.0, 0.01, 0.02], [0.0] * 5, size=SIZE, hfov=HFOV)
    ways = [(i, j) for j in range(5) for i in range(j)]
    points = [replace(matches((cameras[i], cameras[j]), 100, seed=10 * i + j), i=i, j=j) for i, j in ways]

    def nodes():
        return np.stack([camera.mesh.nodes for camera in with_meshes(cameras, points, [NO_LINES[0]] * 5, COARSE)])

    found = nodes()
    monkeypatch.setattr(elastic_system, "EXACT", 1e-9)
    monkeypatch.setattr(elastic_system, "MOST_STEPS", 5000)
    assert np.abs(found - nodes()).max() < CONVERGED


def test_wrong_matches_do_not_pull():
    points, rng = matches(pair(), 1200), np.random.default_rng(5)
    wrong = rng.random(len(points)) < 0.2
    points = replace(points, xy_j=points.xy_j + wrong[:, None] * rng.uniform(-40, 40, points.xy_j.shape))

    bent = with_meshes(pair(), [agreeing(pair(), points)], NO_LINES, COARSE)

    assert rms(bent, matches(pair(), 500, seed=1)) < RECOVERED


def test_matches_that_fit_bend_nothing():
    bent = with_meshes(pair(), [matches(pair(), 500, shift=np.zeros_like)], NO_LINES, COARSE)

    assert max(camera.mesh.largest for camera in bent) < 1e-3  # px


def test_a_displacement_fades_where_there_is_no_evidence():
    bent = with_meshes(pair(), [matches(pair(), 1200)], NO_LINES, COARSE)

    left = np.column_stack([np.zeros(50), np.linspace(0, SIZE[1] - 1, 50)])  # seen by the first photo only
    assert np.linalg.norm(bent[0].mesh.displacement(left), axis=1).max() < FADED


@pytest.mark.parametrize("size", [100.0, 1000.0])
def test_no_pixel_goes_far_and_nothing_folds(size):
    def torn(xy):
        return np.where(xy[:, :1] < 350, -size, size) * [1.0, 0.2]

    bent = with_meshes(pair(), [matches(pair(), 1200, shift=torn)], NO_LINES, COARSE)

    for camera in bent:
        assert camera.mesh.largest <= LARGEST * SIZE[0] + 1e-3  # rounded
        assert camera.mesh.steepness < 1


def test_straight_lines_stay_straight():
    start, end = np.array([220.0, 60.0]), np.array([450.0, 260.0])
    line = start + np.linspace(0, 1, 13)[:, None] * (end - start)
    triples = np.stack([line[:-2], line[1:-1], line[2:]], axis=1)
    points = matches(pair(), 1200)

    def bend(lines):
        mesh = with_meshes(pair(), [points], [lines, lines[:0]], COARSE)[0].mesh
        moved = mesh.straightened(start + np.linspace(0, 1, 100)[:, None] * (end - start))
        across = np.array([[0, -1], [1, 0]]) @ (moved[-1] - moved[0])
        return np.abs((moved - moved[0]) @ across).max() / np.linalg.norm(across)

    assert bend(triples) < STRAIGHT < bend(triples[:0])


@cache
def scene():
    return sphere_scene(procedural_texture(1200, 600, seed=3))


@cache
def photographed(parallax):
    """Cameras that see a scene bent by so many px, and their photos."""
    rng = np.random.default_rng(2)
    mesh = flat_mesh(SIZE, 5)
    meshes = [Mesh(SIZE, rng.uniform(-parallax, parallax, mesh.nodes.shape)) for _ in range(2)]
    cameras = [replace(camera, mesh=one if parallax else None) for camera, one in zip(pair(), meshes, strict=True)]
    return cameras, photograph_plan(scene(), cameras, supersample=1)


@cache
def found(parallax, **options):
    return pipeline.align(photographed(parallax)[1], Options.of(**options))


def true_rms(alignment, cameras):
    return float(np.sqrt((pair_errors(tuple(cameras), alignment.cameras) ** 2).mean()))


def test_photos_with_parallax_are_bent():
    cameras, _ = photographed(8.0)
    plain, bent = found(8.0, local_warp="none"), found(8.0)

    assert plain.local_warp is None
    assert all(camera.mesh is None for camera in plain.cameras)
    assert bent.local_warp.used
    assert bent.local_warp.bent_rms < bent.local_warp.rms / BETTER
    assert true_rms(bent, cameras) < true_rms(plain, cameras) / BETTER
    assert (plain.rms, plain.p95) == (bent.rms, bent.p95)  # of the cameras alone


@cache
def far_ground():
    """Photos of a scene whose lower half goes ever further off, to FAR px: as the ground at one's feet does."""
    mesh = flat_mesh(SIZE, COARSE)
    depth = np.linspace(-0.1, 1.1, mesh.nodes.shape[0])[:, None].clip(0.5) - 0.5
    meshes = [Mesh(SIZE, mesh.nodes + side * FAR * depth[..., None] * [1.0, 0.0]) for side in (-1.0, 1.0)]
    cameras = [replace(camera, mesh=one) for camera, one in zip(pair(), meshes, strict=True)]
    return cameras, photograph_plan(scene(), cameras, supersample=1)


def test_ground_that_no_key_point_and_no_patch_reaches_is_brought_together():
    cameras, photos = far_ground()

    bent = pipeline.align(photos, Options())

    assert bent.local_warp.used
    assert true_rms(bent, cameras) < FAR / NEARER


def test_threads_change_nothing():
    one = found(8.0)
    many = pipeline.align(photographed(8.0)[1], Options(), run=Executor(threads=3))

    assert one.to_json() == many.to_json()


def test_photos_without_parallax_are_left_alone():
    assert found(0.0).to_json() == found(0.0, local_warp="none").to_json()


def test_the_noise_of_key_points_that_could_not_be_measured_is_no_parallax(monkeypatch):
    monkeypatch.setattr(alignment, "refined", lambda *given, **_: list(given[2]))
    _, photos = photographed(0.0)

    left = pipeline.align(photos, Options())

    assert left.p95 > alignment.SHOWS
    assert left.local_warp is None
