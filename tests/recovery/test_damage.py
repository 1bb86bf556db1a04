"""Damage to the program is noticed: each damage breaks the very bound that the healthy program keeps.

Every test here does one thing wrong on purpose and asks the verdict of test_recovery.py.
"""

from dataclasses import replace

import numpy as np
import pytest

from panostitch import features, matching, recognition
from panostitch.alignment import refine, registration, residuals
from panostitch.compositing import exposure, lay_out, make_plan, warp
from panostitch.compositing.blend import bands
from panostitch.errors import AlignmentError, NoOverlapError
from panostitch.geometry import lens
from panostitch.matching import ratio
from panostitch.model.match import VerifiedMatch
from panostitch.options import Options
from panostitch.synthetic.render import photograph_plan
from recovery.bounds import (
    BARREL_PX,
    BARREL_REFINED_PX,
    GAINS_LEFT,
    HOUSE_PX,
    SMALL_PX,
    SMALL_REFINED_PX,
    VIEW_LEVELS,
    aligned,
    error_of,
    truth_of,
    view_error,
    within,
)

STEPS = (0.5, -0.5, 0.5, -0.5)  # EV
ENCODED = 2 ** (np.array(STEPS) / 2.2)  # what they make of the encoded pixels


def is_noticed(known, bound, **options):
    """Whether the headline test would fail: by an error, a photo left out, or cameras that are off."""
    try:
        return not within(known, aligned(known, **options), bound)
    except (AlignmentError, NoOverlapError):
        return True


def through(monkeypatch, change):
    """Every verified link goes through `change` before it reaches the alignment."""

    def changed(*args, **kwargs):
        links = healthy(*args, **kwargs)
        return [change(link) if isinstance(link, VerifiedMatch) else link for link in links]

    healthy = matching.verify
    monkeypatch.setattr(matching, "verify", changed)


LINK_DAMAGES = {
    "points of i and j exchanged": lambda link: replace(link, xy_i=link.xy_j, xy_j=link.xy_i),
    "homography the wrong way round": lambda link: replace(
        link, xy_i=link.xy_j, xy_j=link.xy_i, j_from_i=np.linalg.inv(link.j_from_i)
    ),
    "x and y exchanged": lambda link: replace(link, xy_i=link.xy_i[:, ::-1], xy_j=link.xy_j[:, ::-1]),
    "partners one row off": lambda link: replace(link, xy_j=np.roll(link.xy_j, 1, axis=0)),
    "one pixel off in photo j": lambda link: replace(link, xy_j=link.xy_j + np.array([1.0, 0.0])),
}


@pytest.mark.parametrize("damage", LINK_DAMAGES)
def test_damaged_links(small, monkeypatch, damage):
    through(monkeypatch, LINK_DAMAGES[damage])

    assert is_noticed(small, SMALL_PX)


def test_photos_of_a_match_swapped(small, monkeypatch):
    healthy = matching.match

    def swapped(*args, **kwargs):
        return [replace(match, pairs=match.pairs[:, ::-1]) for match in healthy(*args, **kwargs)]

    monkeypatch.setattr(matching, "match", swapped)
    # pairs name features of the other photo: keep the numbers inside both
    fewest = 900
    detect = recognition.detect
    monkeypatch.setattr(
        recognition, "detect", lambda *args, **kwargs: [f.take(np.arange(fewest)) for f in detect(*args, **kwargs)]
    )

    assert is_noticed(small, SMALL_PX)


def test_cameras_given_to_the_wrong_photos(small):
    wrong = replace(truth_of(small), cameras=(*small.cameras[1:], small.cameras[0]))

    assert view_error(small, wrong) > VIEW_LEVELS


def test_mutual_agreement_and_ratio_test_skipped(house, monkeypatch):
    monkeypatch.setattr(
        ratio,
        "believable",
        lambda neighbours, _: np.column_stack([np.arange(len(neighbours.index)), neighbours.index]).astype(np.int32),
    )

    assert is_noticed(house, HOUSE_PX, work_megapixels=1.0)


@pytest.mark.parametrize("shift", [(1.0, 0.0), (0.0, 1.0), (-0.5, -0.5)])
def test_features_shifted(small, monkeypatch, shift):
    healthy = features.detect_one

    def shifted(photo, options):
        found = healthy(photo, options)
        return replace(found, xy=found.xy + np.array(shift, np.float32))

    monkeypatch.setattr(features, "detect_one", shifted)

    assert is_noticed(small, SMALL_PX)


@pytest.mark.parametrize("megapixels", [1.0, 0.06])
def test_half_pixels_forgotten_in_rescaling(small, monkeypatch, megapixels):
    monkeypatch.setattr(features, "rescale", lambda xy, factor: np.asarray(xy, np.float64) * factor)

    assert is_noticed(small, SMALL_PX, work_megapixels=megapixels)


def test_patches_resampled_a_tenth_of_a_pixel_off(small, monkeypatch):
    healthy = registration._resampled
    monkeypatch.setattr(registration, "_resampled", lambda grey, at, how: healthy(grey, at + np.array([0.1, 0.0]), how))

    assert is_noticed(small, SMALL_REFINED_PX, refine="full")


def test_patches_of_the_wrong_shape(barrel, monkeypatch):
    """As if photos only slid over each other: third-order errors, that cost a tenth of a pixel at the edges."""
    healthy = registration._map

    def slid(camera_i, camera_j, centre):
        at = healthy(camera_i, camera_j, centre)
        down, across = np.meshgrid(registration.NODES, registration.NODES, indexing="ij")
        return at[:, 1:2, 1:2] + np.stack([across, down], axis=-1)

    monkeypatch.setattr(registration, "_map", slid)

    assert is_noticed(barrel, BARREL_REFINED_PX, refine="full")


def test_control_points_not_moved_to_whole_pixels(small, monkeypatch):
    healthy = refine.measured_again

    def measured(points, *args):
        found = healthy(points, *args)
        return replace(found, xy_i=points.xy_i[found.index])

    monkeypatch.setattr(refine, "measured_again", measured)

    assert is_noticed(small, SMALL_REFINED_PX, refine="full")


@pytest.mark.parametrize("shift", [(1, 0), (0, 1)])
def test_warp_shifted_by_a_pixel(small, monkeypatch, shift):
    healthy = warp.Blocks.coordinates.func

    def shifted(grid):
        x, y, valid = healthy(grid)
        return x + np.float32(shift[0]), y + np.float32(shift[1]), valid

    monkeypatch.setattr(warp.Blocks, "coordinates", property(shifted))

    assert view_error(small) > VIEW_LEVELS


def test_half_pixels_forgotten_on_the_grid_of_the_warp(small, monkeypatch):
    healthy = warp._project_grid
    half = (warp.STEP - 1) / 2

    def forgotten(camera, canvas, columns, rows):
        return healthy(camera, canvas, columns - half, rows - half)

    monkeypatch.setattr(warp, "_project_grid", forgotten)

    assert view_error(small) > VIEW_LEVELS


def test_lens_bent_the_wrong_way_in_the_adjustment(barrel, monkeypatch):
    healthy = lens.undistort
    monkeypatch.setattr(residuals.lens, "undistort", lambda xy, k1, k2: healthy(xy, -np.asarray(k1), -np.asarray(k2)))
    try:
        alignment, _ = aligned(barrel)
    except (AlignmentError, NoOverlapError):
        return
    monkeypatch.undo()  # the truth is judged by a healthy lens

    assert not within(barrel, (alignment, error_of(barrel, alignment)), BARREL_PX)


def test_lens_bent_the_wrong_way_in_the_rendering(barrel):
    wrong = [replace(camera, k1=-camera.k1, k2=-camera.k2) for camera in barrel.cameras]

    assert view_error(barrel, replace(truth_of(barrel), cameras=tuple(wrong))) > VIEW_LEVELS


def test_distortion_forgotten(barrel):
    straight = [replace(camera, k1=0.0, k2=0.0) for camera in barrel.cameras]

    assert view_error(barrel, replace(truth_of(barrel), cameras=tuple(straight))) > VIEW_LEVELS


def gains_left(known):
    """Share of the planted exposure steps that the plan leaves."""
    photos = photograph_plan(known.scene, known.cameras, exposures=STEPS, supersample=1)
    options = Options()
    alignment = truth_of(replace(known, photos=photos))
    gains = make_plan(alignment, lay_out(alignment, options.layout), options.compositing, "none").light.brightness
    return np.ptp(np.log(gains * ENCODED)) / np.ptp(np.log(ENCODED))


def test_planted_exposure_is_evened_out(small):
    assert 0.001 < gains_left(small) < GAINS_LEFT


GAIN_DAMAGES = {
    "inverted": lambda gains: 1 / gains,
    "of the photo before": lambda gains: np.roll(gains, 1, axis=0),
    "in linear light": lambda gains: gains**2.2,
    "forgotten": np.ones_like,
}


@pytest.mark.parametrize("damage", GAIN_DAMAGES)
def test_damaged_gains(small, monkeypatch, damage):
    healthy = exposure.EXPOSURE["auto"]

    def damaged(*observed):
        light = healthy(*observed)
        return replace(light, gains=GAIN_DAMAGES[damage](light.gains))

    monkeypatch.setitem(exposure.EXPOSURE, "auto", damaged)

    assert gains_left(small) > GAINS_LEFT


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_blend_weights_that_do_not_sum_to_one(small, monkeypatch, share):
    healthy = bands.Bands.add
    monkeypatch.setattr(
        bands.Bands,
        "add",
        lambda self, photo, weight, *rest, **more: healthy(self, photo, weight * np.float32(share), *rest, **more),
    )

    assert view_error(small) > VIEW_LEVELS


def test_a_photo_missing_from_the_blend(small, monkeypatch):
    healthy = bands.Bands.add
    seen = []

    def forgetful(self, *photo, **more):
        seen.append(1)
        if len(seen) != 2:
            healthy(self, *photo, **more)

    monkeypatch.setattr(bands.Bands, "add", forgetful)

    assert view_error(small) > VIEW_LEVELS
