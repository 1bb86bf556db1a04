"""The start: lenses, focal lengths to try, the tree of the strongest links."""

from dataclasses import replace

import numpy as np
import pytest

from alignment.planted import blank_photos, planted_links
from panostitch.alignment.initialise import (
    START_FIELDS,
    focal_candidates,
    holds_together,
    initial_cameras,
    spanning_tree,
)
from panostitch.geometry import rotation
from panostitch.model.match import VerifiedMatch
from panostitch.model.photo import lens_groups
from panostitch.synthetic.scene import rig

SIZE, FOCAL = (800, 600), 760.0

FROM_HOMOGRAPHIES = 1e-4  # relative; they are exact to about 1e-8, and the focal length hangs on small differences
EXACT_TURN = 1e-6  # rad; homographies along a tree without noise

true = rig(np.deg2rad([-20, 0, 20, 40]), np.deg2rad([2, -3, 1, 0]), np.deg2rad([1, 0, -2, 3]), size=SIZE, focal=FOCAL)


@pytest.fixture
def links(rng):
    return planted_links(true, rng)


def test_same_metadata_and_size_share_a_lens_whichever_way_up():
    photos = blank_photos([replace(true[0], size=size) for size in ((800, 600), (600, 800), (800, 600), (400, 300))])

    assert lens_groups(photos) == [0, 0, 0, 1]
    assert lens_groups([replace(p, lens=lens) for p, lens in zip(photos, ["a", "b", "a", "a"], strict=True)]) == [
        0,
        1,
        0,
        2,
    ]


def test_a_known_focal_length_comes_first(links):
    candidates = focal_candidates(blank_photos(true, focal=700.0), links)

    assert candidates[0] == [700.0] * 4


def test_photos_without_one_take_the_others(links):
    photos = [replace(p, focal=f) for p, f in zip(blank_photos(true), [700.0, None, 720.0, None], strict=True)]

    first = focal_candidates(photos, links)[0]

    assert first == pytest.approx([700, 710, 720, 710])


def test_homographies_tell_the_focal_length(links):
    candidates = focal_candidates(blank_photos(true), links)

    assert candidates[0] == pytest.approx([FOCAL] * 4, rel=FROM_HOMOGRAPHIES)


def test_usual_lenses_are_tried_in_any_case(links):
    widths = [2 * np.arctan(400 / focals[0]) for focals in focal_candidates(blank_photos(true), links)]

    assert np.isin(START_FIELDS.round(6), np.round(widths, 6)).all()


def fake(i, j, inliers):
    points = np.zeros((inliers, 2))
    return VerifiedMatch(i, j, points, points, np.eye(3), inliers, 0.5, 0.5, inliers)


def test_the_tree_takes_the_strongest_links_from_the_best_connected_photo():
    tree = spanning_tree(4, [fake(0, 1, 50), fake(0, 2, 10), fake(1, 2, 80), fake(1, 3, 20), fake(2, 3, 30)])

    assert tree.root == 1  # 150 inliers; photo 2 has 120
    assert {(min(a, b), max(a, b)) for a, b, _ in tree.edges} == {(0, 1), (1, 2), (2, 3)}
    reached = [tree.root]
    for parent, child, link in tree.edges:
        assert parent in reached
        assert {link.i, link.j} == {parent, child}
        reached.append(child)


def test_turns_along_the_tree_are_the_true_ones(links):
    cameras = initial_cameras(blank_photos(true), [FOCAL] * 4, spanning_tree(4, links), links)

    for n in range(1, 4):
        found = cameras[n].cam_from_world @ cameras[0].cam_from_world.T
        known = true[n].cam_from_world @ true[0].cam_from_world.T
        assert rotation.angle(found @ known.T) < EXACT_TURN
    assert cameras[0].centre == ((SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2)


@pytest.mark.parametrize(
    ("count", "pairs", "answer"),
    [(3, [(0, 1), (1, 2)], True), (3, [(0, 1)], False), (4, [(0, 1), (2, 3)], False), (1, [], True), (2, [], False)],
)
def test_whether_links_hold_all_photos_together(count, pairs, answer):
    assert holds_together(count, [fake(i, j, 20) for i, j in pairs]) is answer
