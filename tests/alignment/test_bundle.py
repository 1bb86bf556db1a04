"""Bundle adjustment: its gradient, its gauge, principal points, and how far off it says that it is."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from alignment.planted import common_points, planted_links
from panostitch.alignment import turning_problem as problems
from panostitch.alignment.bundle import Freedom, adjust, standard_errors
from panostitch.alignment.residuals import arrays_of, thinned
from panostitch.alignment.turning_problem import turning_problem
from panostitch.geometry import rotation
from panostitch.model.match import ControlPoints
from panostitch.synthetic.scene import PLANS, rig
from panostitch.synthetic.score import score
from tolerances import UNIT

SIZE, LOSS_SCALE = (800, 600), 2.0
NOISE = 0.5  # px, standard deviation of each coordinate in both photos

EXACT_PX = 1e-6  # px; matches without noise. 1e-11 seen
EXACT_CENTRE = 1e-5  # px; 1e-9 seen

STEP = 1e-6  # of every unknown
GRADIENT = 1e-4  # relative; differences of second order, of costs that are known to 1e-15

# A spread over 150 draws is known to 1 / sqrt(2 * 150 * 3) = 3 % for a turn and to 6 % for a focal length; residuals,
# from which standard errors are told, add 1 %. 20 % is three times that.
AGREEMENT = 0.2
DRAWS = 150

FREEDOMS = [{}, {"terms": 1}, {"terms": 2, "centres": True}, {"focals": (0, 1, 2, 3), "terms": 2, "centres": True}]


def row(count=4, step=22.0, hfov=55.0, **lens):
    jitter = np.deg2rad([1.0, -1.5, 0.8, -0.4, 1.2, -0.9])[:count]
    yaws = np.deg2rad(step) * (np.arange(count) - (count - 1) / 2)
    return rig(yaws, jitter, jitter[::-1] / 2, size=SIZE, hfov=np.deg2rad(hfov), **lens)


def observed(cameras, rng, **more):
    return [thinned(link) for link in planted_links(cameras, rng, **more)]


def freedom_of(cameras, **more):
    return Freedom(**({"focals": (0,) * len(cameras), "lenses": (0,) * len(cameras)} | more))


def shaken(cameras, rng, turn=0.02, focal=1.05):
    return [
        replace(c, focal=c.focal * focal, cam_from_world=rotation.exp(rng.normal(0, turn, 3)) @ c.cam_from_world)
        for c in cameras
    ]


@pytest.mark.parametrize("more", FREEDOMS)
def test_the_gradient_is_that_of_the_cost(more, rng, monkeypatch):
    """What is known of principal points included, made as heavy as the matches."""
    monkeypatch.setattr(problems, "CENTRE_SPREAD", 1e-5)
    monkeypatch.setattr(problems, "MAX_SHIFT", 1.0)
    true = row(k1=-0.1, k2=0.02)
    true = [replace(c, centre=(401.0, 297.5), size=(600, 800) if n == 3 else SIZE) for n, c in enumerate(true)]
    problem = turning_problem(
        true, observed(true, rng, noise=NOISE, outliers=0.05), freedom_of(true, **more), LOSS_SCALE
    )
    start = arrays_of(shaken(true, rng, turn=1e-3, focal=1.001))
    view = problem.view(start)
    tangent = problem.tangent(view)

    gradient = problem.equations(view, tangent).gradient

    assert len(gradient) == problem.places.size
    for n in range(len(gradient)):
        step = STEP * np.eye(len(gradient))[n]
        ahead, behind = (problem.cost(problem.view(problem.moved(start, s)), tangent) for s in (step, -step))
        assert gradient[n] == pytest.approx((ahead - behind) / (2 * STEP), rel=GRADIENT, abs=0.05)
    assert np.abs(gradient).min() > 0.5


def test_unknowns_are_counted():
    sizes = [SIZE, SIZE, SIZE[::-1], SIZE]
    cameras = [replace(camera, size=size) for camera, size in zip(row(), sizes, strict=True)]
    same = freedom_of(cameras, terms=2, centres=True)
    own = freedom_of(cameras, focals=(0, 1, 2, 3), lenses=(0, 0, 1, 1), terms=1)

    assert same.parameters == 3 * 4 + 1 + 2 + 2
    assert own.parameters == 3 * 4 + 4 + 2
    # without the first rotation; a lens has a principal point for each way up
    assert (
        turning_problem(cameras, observed(row(), np.random.default_rng(0)), same, 1.0).places.size == 9 + 1 + 2 + 2 * 2
    )


@pytest.mark.parametrize("plan", ["row", "ring", "two_rows", "rolled", "barrel"])
def test_planted_cameras_are_recovered_exactly(plan, rng):
    true = PLANS[plan]()
    start = shaken([replace(c, k1=0.0, k2=0.0) for c in true], rng)

    solution = adjust(start, observed(true, rng), freedom_of(true, terms=2), loss_scale=50.0)

    assert score(true, solution.cameras).worst < EXACT_PX


def test_a_lens_of_a_hundred_degrees(rng):
    true = row(4, step=35.0, hfov=100.0, k1=-0.02)

    solution = adjust(shaken(true, rng), observed(true, rng), freedom_of(true, terms=1), loss_scale=50.0)

    assert score(true, solution.cameras).worst < EXACT_PX


def test_noise_at_the_edge_of_a_wide_lens_is_weighed_as_what_it_is(rng):
    """A pixel there is half the angle of one in the middle: residuals of either direction alone are not equal."""
    true = row(4, step=35.0, hfov=100.0)
    one_way = observed(true, rng, noise=NOISE)
    both = [one_way, [o.swapped() for o in one_way]]

    first, second = (adjust(true, points, freedom_of(true), loss_scale=LOSS_SCALE).cameras for points in both)

    assert 0.05 < score(true, first).rms < 0.5
    # equal to first order in the noise; of what the noise does, 0.02 is left
    assert score(first, second).rms < 0.1 * score(true, first).rms


def test_the_first_camera_stays_and_the_world_does_not_matter(rng):
    true = row()
    points = observed(true, rng, noise=NOISE)
    start = shaken(true, rng)
    world = rotation.exp(np.array([0.4, -1.0, 2.0]))

    here = adjust(start, points, freedom_of(true, terms=1), loss_scale=LOSS_SCALE)
    there = adjust([c.turned(world) for c in start], points, freedom_of(true, terms=1), loss_scale=LOSS_SCALE)

    np.testing.assert_allclose(here.cameras[0].cam_from_world, start[0].cam_from_world, atol=UNIT)
    assert there.cost == pytest.approx(here.cost, rel=1e-6)
    assert score(here.cameras, there.cameras).worst < 1e-3


def test_rotations_stay_rotations(rng):
    true = row()

    for camera in adjust(shaken(true, rng), observed(true, rng), freedom_of(true), loss_scale=LOSS_SCALE).cameras:
        np.testing.assert_allclose(camera.cam_from_world @ camera.cam_from_world.T, np.eye(3), atol=UNIT)
        assert np.linalg.det(camera.cam_from_world) > 0


def test_a_photo_that_nobody_sees_stays_where_it_is(rng):
    true = row(3)
    points = [*observed(true[:2], rng), ControlPoints(1, 2, np.empty((0, 2)), np.empty((0, 2)))]

    cameras = adjust(true, points, freedom_of(true), loss_scale=LOSS_SCALE).cameras

    np.testing.assert_allclose(cameras[2].cam_from_world, true[2].cam_from_world, atol=UNIT)


def test_principal_points_are_recovered_each_way_up(rng):
    yaws, pitches = np.deg2rad(np.tile([-33, -11, 11, 33], 2)), np.deg2rad(np.repeat([12.0, -13.0], 4))
    rows = rig(yaws, pitches, np.deg2rad([0.5, -0.8, 0.3, 0.0, -0.4, 0.9, -0.2, 0.6]), size=SIZE, hfov=np.deg2rad(55))
    true = [replace(c, centre=(411.0, 290.0)) for c in rows]
    upright = (0, 5)
    true = [replace(c, size=(600, 800), centre=(310.0, 395.0)) if n in upright else c for n, c in enumerate(true)]
    start = [replace(c, centre=((c.size[0] - 1) / 2, (c.size[1] - 1) / 2)) for c in true]
    points = observed(true, rng)

    solution = adjust(shaken(start, rng), points, freedom_of(true, centres=True), loss_scale=50.0)

    for known, found in zip(true, solution.cameras, strict=True):
        assert found.centre == pytest.approx(known.centre, abs=EXACT_CENTRE)
    assert score(true, solution.cameras).worst < EXACT_PX


def test_principal_points_that_do_not_show_stay_in_the_middle(rng):
    # two photos of a long lens: a shift of the principal point is a turn
    true = row(2, step=2.0, hfov=4.0)

    solution = adjust(true, observed(true, rng, noise=NOISE), freedom_of(true, centres=True), loss_scale=LOSS_SCALE)

    off = np.array(solution.cameras[0].centre) - np.array(true[0].centre)
    assert np.abs(off).max() < 2 * problems.CENTRE_SPREAD * SIZE[0]


def errors_of(true, found):
    """Rotation vectors (n, 3) by which cameras are off, about the mean of all."""
    off = [rotation.log(a.cam_from_world.T @ b.cam_from_world) for a, b in zip(true, found, strict=True)]
    return np.array(off) - np.mean(off, axis=0)


def noisy(pair, outliers, rng):
    xy_i, xy_j = (xy + rng.normal(0, NOISE, xy.shape) for xy in (pair.xy_i, pair.xy_j))
    wrong = rng.random(len(pair)) < outliers
    return replace(pair, xy_i=xy_i, xy_j=xy_j + wrong[:, None] * rng.uniform(-25, 25, xy_j.shape))


@pytest.mark.parametrize("outliers", [0.0, 0.05])
def test_standard_errors_are_the_spread_over_many_draws(outliers, rng):
    true = row(5)
    free = freedom_of(true, focals=(0, 0, 0, 1, 1))
    seen = observed(true, rng, count=40)
    turns, focals, predicted = [], [], []
    for _ in range(DRAWS):
        points = [noisy(pair, outliers, rng) for pair in seen]
        cameras = adjust(true, points, free, loss_scale=LOSS_SCALE).cameras
        turns.append(errors_of(true, cameras))
        focals.append([c.focal - t.focal for c, t in zip(cameras, true, strict=True)])
        predicted.append([(u.turn, u.focal) for u in standard_errors(cameras, points, free, loss_scale=LOSS_SCALE)])

    told = np.sqrt(np.mean(np.square(predicted), axis=0))
    np.testing.assert_allclose(told[:, 0], np.sqrt((np.array(turns) ** 2).sum(2).mean(0)), rtol=AGREEMENT)
    np.testing.assert_allclose(told[:, 1], np.sqrt((np.array(focals) ** 2).mean(0)), rtol=AGREEMENT)


def test_four_times_the_matches_halve_the_standard_errors(rng):
    true = row(5)
    few, many = (observed(true, rng, count=count, noise=NOISE) for count in (40, 160))

    told = [standard_errors(true, points, freedom_of(true), loss_scale=LOSS_SCALE) for points in (few, many)]

    for a, b in zip(*told, strict=True):
        assert a.turn / b.turn == pytest.approx(2, rel=AGREEMENT)
        assert a.focal / b.focal == pytest.approx(2, rel=AGREEMENT)


def test_standard_errors_do_not_depend_on_which_photo_is_first(rng):
    true = row(5)
    points = observed(true, rng, noise=NOISE)
    order = [3, 0, 4, 2, 1]
    place = np.argsort(order)
    moved = [ControlPoints(int(place[o.i]), int(place[o.j]), o.xy_i, o.xy_j) for o in points]

    one = standard_errors(true, points, freedom_of(true), loss_scale=LOSS_SCALE)
    other = standard_errors([true[n] for n in order], moved, freedom_of(true), loss_scale=LOSS_SCALE)

    assert [one[n].turn for n in order] == pytest.approx([u.turn for u in other], rel=1e-6)
    assert min(u.turn for u in one) > 0
    # the ends of a row are held by one neighbour
    assert min(one[0].turn, one[-1].turn) > one[2].turn


def test_standard_errors_of_too_few_matches_are_infinite(rng):
    true = row(2)
    points = [o.take(np.arange(2)) for o in observed(true, rng)]

    told = standard_errors(true, points, freedom_of(true), loss_scale=LOSS_SCALE)

    assert [u.turn for u in told] == [np.inf, np.inf]


def test_a_large_job_is_solved_sparsely(rng):
    """Three hundred photos in a chain: a dense matrix would have 800,000 entries."""
    true = rig(np.arange(300) * 0.02, size=SIZE, hfov=np.deg2rad(4))
    points = []
    for i, j in pairwise(range(300)):
        points.append(ControlPoints(i, j, *common_points(true[i], true[j], 10, rng)))
    problem = turning_problem(true, points, freedom_of(true), LOSS_SCALE)

    solution = adjust(shaken(true, rng, turn=1e-4, focal=1.0), points, freedom_of(true), loss_scale=LOSS_SCALE)

    assert problem.layout.stored < 300 * 40
    assert max(np.linalg.norm(errors_of(true, solution.cameras), axis=1)) < 1e-6
