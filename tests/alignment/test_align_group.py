"""Planted cameras are recovered from their matches; what contradicts them is dropped, what cannot be is refused."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from alignment.planted import blank_photos, common_points, link_of, planted_links
from panostitch.alignment import align_group, planar, turning
from panostitch.errors import AlignmentError
from panostitch.geometry import rotation
from panostitch.model.camera import Camera
from panostitch.options import AlignmentOptions
from panostitch.synthetic.scene import PLANS, rig
from panostitch.synthetic.score import score
from tolerances import PIXEL

SIZE, HFOV = (800, 600), np.deg2rad(55)

# Noise-free matches say everything, and the adjustment ends when a step gains less than 1e-6 of the cost: the last
# step, quadratic, leaves rounding only.
EXACT_DEG = 1e-6  # degrees; 4e-14 seen
EXACT_FOCAL = 1e-9  # relative; 4e-16 seen
EXACT_PX = 1e-6  # px; 6e-13 seen
EXACT_LENS = 1e-8  # of k1 and k2; 1e-15 seen

NOISE = 0.5  # px, standard deviation of each coordinate in both photos
# px, rms of the true error under that noise, with 100 matches a link. Seen over 30 seeds: 0.068 to 0.142, hardly more
# with a tenth of outliers. A zero error would mean that the truth was looked at.
NOISY_PX = (0.02, 0.4)
# px, rms of the residuals: sqrt(2) * 0.5 in each of two coordinates is 1.0.
# Seen over 30 seeds: 0.95 to 1.04.
NOISY_RESIDUAL = (0.85, 1.15)

FITTED_BETTER = 1.5  # times; against homographies chained along the tree only. Seen over 5 seeds: 2.9 to 5.1.

WRONG_TURN = np.deg2rad(8)  # of the link that contradicts the others: 100 px


def row(count=5, step=22.0, **lens):
    yaws = np.deg2rad(step) * (np.arange(count) - (count - 1) / 2)
    jitter = np.deg2rad([1.0, -1.5, 0.8, -0.4, 1.2, -0.9])[:count]
    return rig(yaws, jitter, jitter[::-1] / 2, size=SIZE, hfov=HFOV, **lens)


def aligned(cameras, links, photos=None, **options):
    return align_group(
        photos or blank_photos(cameras), links, AlignmentOptions(**{"local_warp": "none", **options}), pixel_size=1.0
    )


def turn_errors(true, found):
    """Degrees by which the relative turns of all pairs are off."""
    return [
        np.rad2deg(
            rotation.angle(
                found[j].cam_from_world
                @ found[i].cam_from_world.T
                @ (true[j].cam_from_world @ true[i].cam_from_world.T).T
            )
        )
        for i, j in combinations(range(len(true)), 2)
    ]


@pytest.mark.parametrize("plan", ["pair", "rolled", "ring", "two_rows", "low_overlap"])
def test_planted_cameras_are_recovered_exactly(plan, rng):
    true = PLANS[plan]()

    alignment = aligned(true, planted_links(true, rng))

    assert alignment.model == "rotation"
    assert max(turn_errors(true, alignment.cameras)) < EXACT_DEG
    for camera, known in zip(alignment.cameras, true, strict=True):
        assert camera.focal == pytest.approx(known.focal, rel=EXACT_FOCAL)
        assert camera.k1 == camera.k2 == 0
    assert score(true, alignment.cameras).worst < EXACT_PX
    assert alignment.rms < EXACT_PX


@pytest.mark.parametrize("lens", [{"k1": -0.12, "k2": 0.02}, {"k1": 0.06}])
def test_distortion_is_recovered_where_it_shows(lens, rng):
    true = row(**lens)

    alignment = aligned(true, planted_links(true, rng))

    for camera in alignment.cameras:
        assert camera.k1 == pytest.approx(lens["k1"], abs=EXACT_LENS)
        assert camera.k2 == pytest.approx(lens.get("k2", 0.0), abs=EXACT_LENS)
    assert score(true, alignment.cameras).worst < EXACT_PX


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("outliers", [0.0, 0.1])
def test_noise_and_outliers_cost_little(seed, outliers):
    true = row()
    rng = np.random.default_rng(seed)

    alignment = aligned(true, planted_links(true, rng, noise=NOISE, outliers=outliers))

    assert NOISY_PX[0] < score(true, alignment.cameras).rms < NOISY_PX[1]
    if not outliers:
        assert NOISY_RESIDUAL[0] < alignment.rms < NOISY_RESIDUAL[1]


def test_lens_that_does_not_pay_is_not_bent(rng):
    alignment = aligned(row(), planted_links(row(), rng, noise=NOISE))

    assert {(camera.k1, camera.k2) for camera in alignment.cameras} == {(0.0, 0.0)}


def test_first_and_second_photo_may_change_places(rng):
    true = row(3)
    links = planted_links(true, rng)
    swapped = [
        replace(link, i=2 - link.j, j=2 - link.i, xy_i=link.xy_j, xy_j=link.xy_i, j_from_i=np.linalg.inv(link.j_from_i))
        for link in links
    ]

    alignment = aligned(true[::-1], swapped)

    assert score(true[::-1], alignment.cameras).worst < EXACT_PX


def test_photos_of_two_lenses(rng):
    wide, narrow = row(4), row(4)
    narrow = [replace(camera, focal=1.4 * camera.focal) for camera in narrow]
    true = [wide[0], narrow[1], wide[2], narrow[3]]
    photos = [replace(p, lens="ab"[n % 2]) for n, p in enumerate(blank_photos(true))]

    alignment = aligned(true, planted_links(true, rng), photos)

    assert score(true, alignment.cameras).worst < EXACT_PX


def test_links_are_summed_up(rng):
    links = planted_links(row(), rng, noise=NOISE)

    alignment = aligned(row(), links)

    assert [(link.i, link.j) for link in alignment.links] == [(link.i, link.j) for link in links]
    assert all(link.matches == 100 for link in alignment.links)
    together = np.sqrt(np.mean([link.rms**2 for link in alignment.links]))
    assert together == pytest.approx(alignment.rms, abs=PIXEL)


def wrong_link(true, i, j, rng):
    """A link whose matches agree with each other, but on a camera that stands elsewhere."""
    turned = replace(true[j], cam_from_world=rotation.exp(np.array([0, WRONG_TURN, 0])) @ true[j].cam_from_world)
    points = rng.uniform(200, 500, (80, 2))
    there = turned.project(true[i].rays(points))
    return link_of(i, j, points, there)


@pytest.mark.parametrize("position", [0, 3, None])
def test_a_link_that_contradicts_the_others_is_dropped_and_named(position, rng):
    true = row(4, step=12.0)
    links = [link for link in planted_links(true, rng, noise=NOISE) if (link.i, link.j) != (0, 3)]
    assert len(links) == 5
    wrong = wrong_link(true, 0, 3, rng)
    given = [*links, wrong] if position is None else [*links[:position], wrong, *links[position:]]

    alignment = aligned(true, given)

    assert {(link.i, link.j) for link in alignment.links} == {(link.i, link.j) for link in links}
    assert [(link.i, link.j) for link in alignment.dropped] == [(0, 3)]
    assert alignment.dropped[0].rms > 50
    assert score(true, alignment.cameras).rms < NOISY_PX[1]


def ring(count=10):
    yaws = np.linspace(-np.pi, np.pi, count, endpoint=False)
    return rig(yaws, np.zeros(count), np.zeros(count), size=SIZE, hfov=HFOV)


def weak(link):
    """As among photos that agree in a pattern, and in nothing around it."""
    return replace(link, in_overlap=5 * link.inliers)


def test_a_weak_link_that_bends_a_whole_ring_is_dropped_and_named(rng):
    true = ring()
    links = [link for link in planted_links(true, rng, noise=NOISE) if (link.i, link.j) != (0, 1)]
    # photo 9 shows what photo 0 shows: a ring of nine closes, which no link contradicts
    wrong = weak(link_of(1, 9, *common_points(true[1], true[0], 40, rng)))

    alignment = aligned(true, [*links, wrong])

    assert [(link.i, link.j) for link in alignment.dropped] == [(1, 9)]
    # as if it had never been there
    assert score(true, alignment.cameras).rms == pytest.approx(score(true, aligned(true, links).cameras).rms, abs=PIXEL)


def test_a_weak_link_that_closes_a_ring_rightly_is_kept(rng):
    true = ring()
    links = [weak(link) if (link.i, link.j) == (0, 1) else link for link in planted_links(true, rng, noise=NOISE)]

    alignment = aligned(true, links)

    assert not alignment.dropped
    assert score(true, alignment.cameras).rms < NOISY_PX[1]


def test_the_only_link_to_a_photo_is_not_dropped(rng):
    true = row(3)
    links = [link for link in planted_links(true, rng) if (link.i, link.j) != (0, 2)]

    alignment = aligned(true, links)

    assert len(alignment.links) == 2
    assert len(alignment.cameras) == 3


def test_no_lens_that_could_exist(rng, monkeypatch):
    # every start ends at 55 degrees; were no such lens to be had, nothing would be left
    monkeypatch.setattr(turning, "MAX_FIELD", 50.0)

    with pytest.raises(AlignmentError) as caught:
        aligned(row(3), planted_links(row(3), rng), model="rotation")

    assert caught.value.exit_code == 6
    assert "no lens" in caught.value.message
    assert "--model homography" in caught.value.hint


def test_cameras_that_explain_nothing_are_refused(rng):
    true = row(3)
    links = [link_of(i, j, *rng.uniform((0, 0), SIZE, (2, 100, 2))) for i, j in ((0, 1), (1, 2))]

    with pytest.raises(AlignmentError):
        aligned(true, links)


def test_a_flat_subject_is_recognised_by_two_photos(rng):
    true = PLANS["plane_pair"]()

    alignment = aligned(true, planted_links(true, rng, noise=NOISE))

    assert alignment.model == "homography"
    assert "flat" in alignment.reason
    assert score(true, alignment.cameras).rms < NOISY_PX[1]


def test_a_turning_camera_is_not_taken_for_a_flat_subject(rng):
    assert aligned(PLANS["pair"](), planted_links(PLANS["pair"](), rng, noise=NOISE)).model == "rotation"


def test_a_shifted_image_and_a_breathing_lens_are_not_taken_for_a_flat_subject(rng):
    straight = row(6, 14.0, k1=-0.1, k2=0.3)
    x, y = straight[0].centre
    shifted = (x + 0.01 * SIZE[0], y - 0.04 * SIZE[1])
    breaths = (1.0, 1.02, 0.99, 1.01, 0.98, 1.0)
    cameras = [replace(c, focal=c.focal * n, centre=shifted) for c, n in zip(straight, breaths, strict=True)]

    found = aligned(cameras, planted_links(cameras, rng, noise=NOISE), refine="none")

    assert found.model == "rotation"


def test_asked_for_a_homography(rng):
    true = PLANS["pair"]()

    alignment = aligned(true, planted_links(true, rng), model="homography")

    assert alignment.model == "homography"
    assert score(true, alignment.cameras).worst < EXACT_PX


def test_same_every_time(rng):
    links = planted_links(row(), rng, noise=NOISE, outliers=0.1)

    assert aligned(row(), links).to_json() == aligned(row(), links).to_json()


@pytest.mark.parametrize("count", [2, 3, 4])
def test_photos_of_a_plane_recover_their_homographies(count, rng):
    plane = [
        np.array([[1, 0.02 * n, -250 * n], [-0.01 * n, 1, 20 * n], [1e-5 * n, -2e-5 * n, 1]]) for n in range(count)
    ]
    true = [Camera(SIZE, 1.0, (0.0, 0.0), matrix) for matrix in plane]
    links = planted_links(true, rng)

    alignment = aligned(true, links, model="homography")

    assert score(true, alignment.cameras).worst < EXACT_PX
    assert len(alignment.links) == len(links)
    assert alignment.rms < EXACT_PX


def test_photos_of_a_plane_are_fitted_to_all_their_neighbours(monkeypatch):
    flat = [(0, 0), (250, 10), (500, -10), (0, 200), (250, 210), (500, 190)]
    true = [Camera(SIZE, 1.0, (0.0, 0.0), np.array([[1.0, 0, -x], [0, 1, -y], [1e-5, 0, 1]])) for x, y in flat]
    links = planted_links(true, np.random.default_rng(3), noise=NOISE)

    fitted = score(true, aligned(true, links, model="homography").cameras).rms
    monkeypatch.setattr(planar, "MAX_STEPS", 0)
    chained = score(true, aligned(true, links, model="homography").cameras).rms

    assert NOISY_PX[0] < fitted < chained / FITTED_BETTER
