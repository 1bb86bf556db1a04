"""The judge of our own panoramas, on flat pictures whose cameras are known, right or planted wrong."""

from dataclasses import replace

import numpy as np
import pytest

from compositing.mosaics import alignment_of, panorama_of, shifted
from panostitch.model.match import ControlPoints
from panostitch.options import CompositingOptions, LayoutOptions
from panostitch.runtime.executor import Executor
from panostitch.scoring import score_seams
from scoring.planted import perfect

SIZE = (320, 200)
STEP = 200  # px between the pictures
LITTLE = 0.2  # of a perfect seam's total; observed 0.05
SHIFTS = (0.0, 1.0, 2.0, 4.0)  # px by which a camera is wrong


def mosaic(wrong=0.0, tint=0.0, noise=1.0):
    """Two overlapping pieces of one picture; the second lies wrong by so many px, or is redder by so much."""
    rng = np.random.default_rng(4)
    whole = perfect().astype(np.float64)
    pieces = [
        whole[:, :320] + rng.normal(0, noise, (200, 320, 3)),
        whole[:, 200:520] + rng.normal(0, noise, (200, 320, 3)),
    ]
    pieces[1] *= [1 + tint, 1, 1 - tint]
    cameras = [shifted(SIZE, 0, 0), shifted(SIZE, STEP + 0.6 * wrong, 0.8 * wrong)]
    return alignment_of(cameras, [np.clip(np.rint(p), 0, 255).astype(np.uint8) for p in pieces], model="similarity")


def seams_of(alignment, **options):
    # straight seams, so that the shift cannot be avoided
    compositing = CompositingOptions(seams="voronoi", exposure="none", **options)
    panorama = panorama_of(alignment, layout=LayoutOptions(crop="none"), compositing=compositing)
    return score_seams(panorama, compositing)


def test_a_perfect_seam_scores_near_zero():
    (seam,) = seams_of(mosaic())
    assert (seam.first, seam.second) == ("p0", "p1")
    assert SIZE[1] * np.pi / 4 <= seam.length <= SIZE[1] * np.pi / 2  # the estimate is for any direction
    assert seam.score.places > 50
    assert seam.score.total < LITTLE


def test_larger_shifts_score_higher_and_are_measured():
    scores = [seams_of(mosaic(wrong))[0].score for wrong in SHIFTS]
    assert [s.total for s in scores] == sorted(s.total for s in scores)
    assert scores[-1].displacement_p95 == pytest.approx(SHIFTS[-1], abs=0.4)


def test_where_labels_go_on_beyond_all_photos_there_is_no_seam():
    pictures = [np.full((200, 320, 3), 90, np.uint8)] * 2
    apart = alignment_of([shifted(SIZE, 0, 0), shifted(SIZE, 1900, 1500)], pictures, model="similarity")
    assert sum(seam.score.places for seam in seams_of(apart)) == 0


def test_a_step_of_colour_scores_by_its_size():
    hard = [seams_of(mosaic(tint=tint), blender="none")[0].score for tint in (0.0, 0.05, 0.15)]
    assert [s.colour for s in hard] == sorted(s.colour for s in hard)
    assert hard[-1].colour > 3 * hard[0].colour


def test_control_points_that_were_fitted_say_nothing():
    x, y = np.meshgrid(np.arange(210.0, 320.0, 6.0), np.arange(0.0, 200.0, 6.0))
    there = np.column_stack([x.ravel(), y.ravel()])
    fitted = ControlPoints(0, 1, there, there - [STEP, 0])
    (seam,) = seams_of(replace(mosaic(4.0), control_points=(fitted,)))
    assert seam.score.displacement is None
    assert seam.score.known == 0
    assert seam.score.structure > 1  # grey levels: what is seen is said all the same


def test_threads_change_nothing():
    alignment, options = mosaic(2.0), CompositingOptions()
    panorama = panorama_of(alignment, compositing=options)
    assert score_seams(panorama, options) == score_seams(panorama, options, run=Executor(3))


def test_the_trace_has_all_places():
    events = {}
    panorama = panorama_of(mosaic(), compositing=CompositingOptions())
    seams = score_seams(panorama, CompositingOptions(), trace=lambda event, **data: events.update({event: data}))
    data = events["scoring.judged"]
    assert data["seams"] == seams
    assert len(data["places"]) == sum(seam.score.places for seam in seams)
