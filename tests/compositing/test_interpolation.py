"""How photos are sampled: the kernels, and what becomes of detail that a smaller panorama cannot hold."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from compositing.mosaics import alignment_of, panorama_of, shifted
from panostitch.compositing import lay_out, warp
from panostitch.compositing.compose import INTERPOLATION
from panostitch.model.photo import Photo
from panostitch.options import CompositingOptions, LayoutOptions
from panostitch.synthetic.render import ArraySource
from panostitch.synthetic.scene import rig

SIZE = (900, 700)
FINEST = 340  # px from the middle, where the rings of the zone plate have 0.5 cycles a pixel
CONTRAST = 100.0  # grey levels

# Share of the energy of rings finer than the canvas can hold that is left: it shows as rings that are not there.
# 0.01, 0.05 and 0.03 seen; photos sampled as they are would leave 0.8, 0.5 and 0.6.
ALIASED = 0.08
UNFILTERED = 0.35
KEPT = 0.45  # share of the energy of rings of 0.25 to 0.35 cycles a canvas pixel; 0.56 to 0.7 seen


def zone_plate():
    """Rings that become finer outwards, and the distance (px) of each pixel from the middle."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] - (np.array(SIZE[::-1]) - 1).reshape(2, 1, 1) / 2
    radius = np.hypot(x, y)
    rings = np.where(radius < FINEST, CONTRAST * np.cos(np.pi / 2 / FINEST * radius**2), 0)
    return np.repeat(np.rint(127.5 + rings)[..., None], 3, axis=2).astype(np.uint8)


def energies(scale, *, reduce_below):
    """Share of the energy left: of rings too fine for a canvas of this scale, and of rings that it can hold."""
    camera = rig([0.0], size=SIZE, focal=1000.0)[0]
    canvas = lay_out(alignment_of([camera]), LayoutOptions(scale=scale, projection="rectilinear"))
    photo = Photo("zones", SIZE, ArraySource(zone_plate()))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(warp, "REDUCE_BELOW", reduce_below)
        raster, reduced = warp.read_for(photo, camera, canvas)
    layer = warp.warp_and_place(raster, reduced, canvas, canvas.region, interpolation=cv2.INTER_CUBIC)[0]
    x, y = np.meshgrid(*(np.arange(n, dtype=float) for n in canvas.size))
    seen = camera.project(canvas.rays(np.column_stack([x.ravel(), y.ravel()]))) - (np.array(SIZE) - 1) / 2
    radius = np.hypot(*seen.T).reshape(x.shape)
    cycles = radius / FINEST / 2 / scale  # per canvas pixel
    ring = layer.pixels[..., 0] - 127.5
    fine, coarse = (cycles > 0.58) & (radius < FINEST - 8), (cycles > 0.25) & (cycles < 0.35)
    return tuple(float((ring[where] ** 2).mean() / (CONTRAST**2 / 2)) for where in (fine, coarse))


@pytest.mark.parametrize("scale", [0.3, 0.5, 0.7])
def test_detail_that_a_smaller_panorama_cannot_hold_does_not_come_back_as_another(scale):
    aliased, kept = energies(scale, reduce_below=warp.REDUCE_BELOW)
    unfiltered, _ = energies(scale, reduce_below=0.0)

    assert aliased < ALIASED
    assert unfiltered > UNFILTERED
    assert kept > KEPT


@pytest.mark.parametrize("name", INTERPOLATION)
def test_every_kernel_keeps_a_photo_that_lies_on_the_grid(name):
    camera = shifted((160, 120), 0, 0)
    picture = np.random.default_rng(3).integers(0, 256, (120, 160, 3), dtype=np.uint8)
    options = CompositingOptions(exposure="none", interpolation=name)

    panorama = panorama_of(
        alignment_of([camera], [picture], model="similarity"), layout=LayoutOptions(crop="none"), compositing=options
    )

    np.testing.assert_array_equal(panorama.read(panorama.canvas.region).pixels[1:-1, 1:-1], picture)


def test_kernels_are_as_sharp_as_they_are_said_to_be():
    """Rings of 0.2 to 0.27 cycles a pixel, a third of a pixel aside: what each kernel makes of their true values."""
    y, x = np.mgrid[:300, :300] - 149.5
    camera, aside = rig([0.0], size=(300, 300), focal=500.0)[0], 1 / 3
    picture = np.repeat(np.rint(127.5 + CONTRAST * np.cos(0.006 * (x**2 + y**2)))[..., None], 3, axis=2).astype(
        np.uint8
    )
    canvas = lay_out(alignment_of([camera]), LayoutOptions(projection="rectilinear"))
    canvas = replace(canvas, origin=tuple(o + aside for o in canvas.origin))
    x, y = np.meshgrid(*(np.arange(n, dtype=float) for n in canvas.size))
    seen = (camera.project(canvas.rays(np.column_stack([x.ravel(), y.ravel()]))) - 149.5).reshape(*x.shape, 2)
    square = (seen**2).sum(2)
    band = (square > 210**2 / 4) & (square < 140**2) & (np.abs(seen).max(2) < 140)
    errors = {}
    for name, flag in INTERPOLATION.items():
        layer = warp.warp_and_place((picture, None), camera, canvas, canvas.region, interpolation=flag)[0]
        off = layer.pixels[..., 0] - (127.5 + CONTRAST * np.cos(0.006 * square))
        errors[name] = float(np.sqrt((off[band] ** 2).mean()))

    assert errors["lanczos"] < errors["cubic"] < errors["linear"] < errors["nearest"]
