"""What is said of photos that are in no panorama."""

import numpy as np

from panostitch.diagnosis import explain_left_out
from panostitch.matching import find_groups
from panostitch.model.features import Attempt
from panostitch.model.finding import Finding
from panostitch.model.match import Rejection, VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource

POINTS = np.zeros((20, 2))


def link(i, j):
    return VerifiedMatch(i, j, POINTS, POINTS, np.eye(3), 30, 0.4, 0.5, 30)


def photos_of(count):
    return [Photo(f"p{n}.jpg", (40, 30), ArraySource(np.zeros((30, 40, 3), np.uint8))) for n in range(count)]


def test_a_lonely_photo_is_told_its_best_partner_and_the_numbers():
    links = [
        link(0, 1),
        Rejection(0, 2, "too few matches agree", putative=40, inliers=6, needed=21),
        Rejection(1, 2, "too few matches agree", putative=30, inliers=11, needed=18),
    ]

    (left_out,) = explain_left_out(photos_of(3), links, find_groups(3, links), kept=(0, 1))

    assert left_out.name == "p2.jpg"
    assert left_out.reason == "overlaps no other photo"
    assert left_out.details == ("best partner: p1.jpg, 30 matches, 11 agree (18 needed): too few matches agree",)
    assert left_out.hint


def test_a_lonely_photo_is_told_how_it_was_sought_and_how_far_the_best_pair_overlaps():
    links = [Rejection(0, 1, "too few matches agree", putative=28, inliers=9, needed=12, overlap=0.06)]
    attempts = [(Attempt("sift", 0.25), Attempt("akaze", 1.0, "local")), (Attempt("sift", 0.25),)]

    first, second = explain_left_out(photos_of(2), links, find_groups(2, links), kept=(), attempts=attempts)

    assert first.details == (
        "best partner: p1.jpg, 28 matches, 9 agree (12 needed), overlap about 6%: too few matches agree",
        "tried: sift at 0.25 MP, akaze at 1 MP with evened contrast",
    )
    assert second.details[1] == "tried: sift at 0.25 MP"


def test_an_overlap_that_chance_made_up_is_not_told():
    links = [Rejection(0, 1, "too few matches agree", putative=28, inliers=6, needed=12, overlap=0.97)]

    (first, _) = explain_left_out(photos_of(2), links, find_groups(2, links), kept=())

    assert "overlap" not in first.details[0]


def test_more_matches_break_a_tie_of_inliers():
    links = [Rejection(0, 1, "a", putative=5, inliers=3), Rejection(0, 2, "b", putative=9, inliers=3)]

    first = explain_left_out(photos_of(3), links, find_groups(3, links), kept=())[0]

    assert "p2.jpg, 9 matches" in first.details[0]


def test_a_photo_of_another_panorama_is_told_with_whom_it_belongs():
    links = [link(0, 1), link(1, 2), link(3, 4)]

    left_out = explain_left_out(photos_of(5), links, find_groups(5, links), kept=(0, 1, 2))

    assert [photo.name for photo in left_out] == ["p3.jpg", "p4.jpg"]
    assert left_out[0].reason == "belongs to another panorama, with p4.jpg"
    assert "batch" in left_out[0].hint


def test_long_lists_of_names_are_cut():
    links = [link(n, n + 1) for n in range(5)]

    left_out = explain_left_out(photos_of(6), links, find_groups(6, links), kept=())

    assert left_out[0].reason == "belongs to another panorama, with p1.jpg, p2.jpg, p3.jpg and 2 more"


def test_a_photo_without_any_pair_is_explained_too():
    (left_out,) = explain_left_out(photos_of(1), [], find_groups(1, []), kept=())

    assert (left_out.reason, left_out.details) == ("overlaps no other photo", ())


def test_kept_photos_are_not_explained():
    links = [link(0, 1)]

    assert explain_left_out(photos_of(2), links, find_groups(2, links), kept=(0, 1)) == []


def test_the_cause_comes_first_and_the_partner_is_the_one_that_tells_most():
    links = [
        link(0, 1),
        Rejection(0, 2, "too few matches agree", putative=40, inliers=6, needed=21),
        Rejection(1, 2, "too few matches agree", putative=30, inliers=5, needed=18),
    ]
    finding = Finding("p2.jpg", "p1.jpg", "too little overlap", "they have 4 % in common", "one more", overlap=0.04)

    (photo,) = explain_left_out(photos_of(3), links, find_groups(3, links), kept=(0, 1), findings=[finding])

    assert (photo.cause, photo.hint) == ("too little overlap", "one more")
    assert photo.reason == "is linked to no other photo"
    assert photo.details == (
        "cause: too little overlap: they have 4 % in common",
        "best partner: p1.jpg, 30 matches, 5 agree (18 needed), overlap about 4%: too few matches agree",
    )


def test_what_keeps_two_panoramas_apart_is_told_to_all_of_the_smaller_one():
    links = [link(0, 1), link(1, 2), link(3, 4)]
    finding = Finding("p3.jpg", "p2.jpg", "blur", "p3.jpg is soft", "take p3.jpg again", culprit="p3.jpg")

    found = explain_left_out(photos_of(5), links, find_groups(5, links), kept=(0, 1, 2), findings=[finding])

    assert [(photo.cause, photo.hint) for photo in found] == [("blur", "take p3.jpg again")] * 2
    assert "p3.jpg - p2.jpg: blur" in found[1].details[0]


def test_a_weak_link_is_no_reason_to_be_left_out():
    links = [link(0, 1)]
    finding = Finding("p2.jpg", "p1.jpg", "blur", "p2.jpg is soft", "take p2.jpg again", weak=True)

    (photo,) = explain_left_out(photos_of(3), links, find_groups(3, links), kept=(0, 1), findings=[finding])

    assert photo.cause == ""
