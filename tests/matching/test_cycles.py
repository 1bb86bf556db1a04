"""Wrong links are found by the cycles they lie on; true ones stay, however rough."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from alignment.planted import blank_photos
from panostitch.geometry import homography, rotation
from panostitch.matching.cycles import contradicting, drop_contradictions
from panostitch.model.match import Rejection, VerifiedMatch
from panostitch.synthetic.scene import rig

SIZE, HFOV = (800, 600), np.deg2rad(55)
NOISE = 0.5  # px
PARALLAX = 0.01  # of the width: what near things do to a homography
WINDOW = (0.12, 0.35)  # of the width: from one window to the next
FAR = 0.5  # radians by which a photo that shows something else seems to be turned


def grid(rows, columns, step=25.0):
    """Cameras in rows of different pitch: each is linked to some ten others."""
    pitches = 20.0 * (np.arange(rows) - (rows - 1) / 2)
    yaws = step * (np.arange(columns) - (columns - 1) / 2)
    return rig(
        np.deg2rad(np.tile(yaws, rows)), np.deg2rad(np.repeat(pitches, columns)), np.deg2rad(1.0), size=SIZE, hfov=HFOV
    )


def common_points(a, b, rng, count=60):
    xy = rng.uniform(0, a.size, (1200, 2))
    there = b.project(a.rays(xy))
    inside = ((there >= 0) & (there <= np.array(b.size) - 1)).all(1)
    return (xy[inside][:count], there[inside][:count]) if inside.sum() >= count else None


def swayed(xy, rng, amount):
    """Points moved by a smooth wave of this amplitude, a share of the width: another depth in another place."""
    phase, pace = rng.uniform(0, 2 * np.pi, 2), rng.uniform(0.5, 1.5, (2, 2))
    wave = np.sin(2 * np.pi * xy / SIZE[0] @ pace + phase)
    return xy + amount * SIZE[0] * wave


def link_between(cameras, i, j, seen, rng, *, parallax=0.0, putative=80):
    """The link of photos i < j, the second of which is taken to be what the camera `seen` sees; None if too narrow."""
    points = common_points(cameras[i], seen, rng)
    if points is None:
        return None
    xy_i, xy_j = points[0], swayed(points[1], rng, parallax) + rng.normal(0, NOISE, points[1].shape)
    start = lens(seen) @ seen.cam_from_world @ cameras[i].cam_from_world.T @ np.linalg.inv(lens(cameras[i]))
    fitted = homography.refine(homography.normalised(start, xy_i.mean(0)), xy_i, xy_j, scale=30.0)
    return VerifiedMatch(i, j, xy_i, xy_j, fitted, putative, 0.4, 0.5, putative)


def lens(camera):
    return np.array([[camera.focal, 0, camera.centre[0]], [0, camera.focal, camera.centre[1]], [0, 0, 1]])


def true_links(cameras, rng, *, parallax=0.0):
    pairs = combinations(range(len(cameras)), 2)
    links = [link_between(cameras, i, j, cameras[j], rng, parallax=parallax) for i, j in pairs]
    return [link for link in links if link is not None]


def seen_turned(cameras, i, j, turn, rng, *, putative=120):
    """A link as if photo j were taken with camera i, turned by `turn` (3,) radians."""
    other = replace(cameras[j], cam_from_world=rotation.exp(np.array(turn)) @ cameras[i].cam_from_world)
    return link_between(cameras, i, j, other, rng, putative=putative)


def one_window_on(cameras, link, rng):
    """The link with its matches moved sideways by a window; None where they move out of the photo."""
    shift = rng.uniform(*WINDOW) * rng.choice([-1, 1]) * HFOV
    turned = replace(cameras[link.j], cam_from_world=rotation.exp([0, shift, 0]) @ cameras[link.j].cam_from_world)
    return link_between(cameras, link.i, link.j, turned, rng, putative=100)


def names(links, numbers):
    return {(links[n].i, links[n].j) for n in numbers}


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("parallax", [0.0, PARALLAX])
def test_true_links_stay(seed, parallax):
    rng = np.random.default_rng(seed)
    cameras = grid(2, 6, step=rng.uniform(18, 30))

    assert contradicting(blank_photos(cameras), true_links(cameras, rng, parallax=parallax)) == {}


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("parallax", [0.0, PARALLAX])
def test_repeated_windows_are_found_and_nothing_else(seed, parallax):
    rng = np.random.default_rng(seed)
    cameras = grid(3, 5)
    links = true_links(cameras, rng, parallax=parallax)
    wrong = set()
    for n in rng.permutation(len(links)):
        moved = one_window_on(cameras, links[n], rng)
        if moved is not None and len(wrong) < 3:
            links[n] = moved
            wrong.add(int(n))

    assert set(contradicting(blank_photos(cameras), links)) == wrong
    assert len(wrong) == 3


@pytest.mark.parametrize("seed", range(6))
def test_the_same_pattern_twice(seed):
    rng = np.random.default_rng(seed)
    cameras = grid(2, 8)
    links = true_links(cameras, rng)
    linked = {(link.i, link.j) for link in links}
    # not the farthest: the error to be expected of a chain right across the panorama says nothing any more
    apart = [(i, j) for i, j in combinations(range(16), 2) if (i, j) not in linked and (j - i) % 8 in (3, 4)]
    chosen = [apart[n] for n in rng.choice(len(apart), 2, replace=False)]
    links += [seen_turned(cameras, i, j, rng.uniform(-FAR, FAR) * np.array([0, 1, 0]), rng) for i, j in chosen]

    assert names(links, contradicting(blank_photos(cameras), links)) == set(chosen)


def test_two_wrong_links_that_agree_with_each_other(rng):
    cameras = grid(1, 9, step=12.0)
    links = [link for link in true_links(cameras, rng) if link.j - link.i <= 2]
    # photo 8 seems to stand where photo 2 does, and photos 1 and 3 agree about it
    false = [link_between(cameras, n, 8, cameras[2], rng, putative=100) for n in (1, 3)]

    found = contradicting(blank_photos(cameras), [*links, *false])

    assert names([*links, *false], found) == {(1, 8), (3, 8)}


def test_wrong_links_that_agree_with_each_other_and_with_little_of_the_photos(rng):
    cameras = rig(np.deg2rad(np.arange(8) * 45.0), size=SIZE, hfov=np.deg2rad(75))
    links = [replace(link, in_overlap=2 * link.inliers) for link in true_links(cameras, rng)]
    # photo 4 seems to be where photo 0 is, and its neighbours agree: one mistake makes three links
    false = [
        link_between(cameras, i, j, replace(cameras[j], cam_from_world=cameras[k].cam_from_world), rng)
        for i, j, k in ((0, 4, 0), (1, 4, 0), (0, 3, 7))
    ]
    poor = [replace(link, in_overlap=8 * link.inliers) for link in false]

    assert names([*links, *poor], contradicting(blank_photos(cameras), [*links, *poor])) == {(0, 4), (1, 4), (0, 3)}


def test_every_wrong_link_of_one_photo_is_found(rng):
    cameras = grid(3, 5)
    hub = 7  # in the middle: most photos are linked to it
    links = true_links(cameras, rng)
    wrong = [n for n, link in enumerate(links) if hub in (link.i, link.j)][:3]
    for n in wrong:
        links[n] = one_window_on(cameras, links[n], rng) or links[n]

    assert sorted(contradicting(blank_photos(cameras), links)) == wrong


def test_a_link_across_a_ring_without_triangles(rng):
    cameras = rig(np.deg2rad(np.arange(10) * 36.0), size=SIZE, hfov=HFOV)
    links = true_links(cameras, rng)
    assert {(link.j - link.i) % 8 for link in links} == {1}
    across = seen_turned(cameras, 2, 6, (0, 0.1, 0), rng, putative=150)

    found = contradicting(blank_photos(cameras), [*links, across])

    assert list(found) == [len(links)]


def test_a_ring_may_close():
    for seed in range(5):
        rng = np.random.default_rng(seed)
        cameras = rig(np.deg2rad(np.arange(10) * 36.0), size=SIZE, hfov=HFOV)

        assert contradicting(blank_photos(cameras), true_links(cameras, rng, parallax=PARALLAX)) == {}


def test_without_a_cycle_nothing_can_be_said(rng):
    cameras = grid(1, 4)
    links = [link for link in true_links(cameras, rng) if link.j - link.i == 1]
    links[1] = one_window_on(cameras, links[1], rng)

    assert contradicting(blank_photos(cameras), links) == {}
    assert contradicting([], []) == {}


def test_order_and_numbers_are_kept_and_the_reason_is_told(rng):
    cameras = grid(2, 5)
    links = true_links(cameras, rng)
    wrong = seen_turned(cameras, 0, 3, (0, 0.1, 0), rng)
    refused = Rejection(4, 5, "too few matches", putative=7)
    given = [refused, *links[:4], wrong, *links[4:]]

    after = drop_contradictions(blank_photos(cameras), given)

    assert [link for n, link in enumerate(after) if n != 5] == [link for n, link in enumerate(given) if n != 5]
    dropped = after[5]
    assert isinstance(dropped, Rejection)
    assert (dropped.i, dropped.j, dropped.putative, dropped.inliers) == (0, 3, wrong.putative, wrong.inliers)
    assert dropped.needed == 0
    assert dropped.overlap == wrong.overlap
    assert dropped.reason.startswith("contradicts the other links (via p")
    assert dropped.reason.endswith(" px off)")


def test_the_order_of_links_does_not_matter(rng):
    cameras = grid(3, 4)
    links = true_links(cameras, rng)
    links[3], links[10] = (one_window_on(cameras, links[n], rng) for n in (3, 10))
    order = rng.permutation(len(links))
    photos = blank_photos(cameras)

    first = names(links, contradicting(photos, links))
    shuffled = [links[n] for n in order]

    assert first
    assert names(shuffled, contradicting(photos, shuffled)) == first
