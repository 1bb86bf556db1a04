"""Everything is tried: formats are written and read, detectors look at a picture, a known scene is stitched."""

import os
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import map_coordinates

from panostitch import pipeline
from panostitch.features import DETECTORS
from panostitch.io.limits import DEEP
from panostitch.io.readers import FORMATS, open_photo
from panostitch.io.writers import EXTENSIONS, assemble, write_panorama
from panostitch.jobs.doctor.check import Check, tried
from panostitch.jobs.doctor.packages import OPENCV, anew
from panostitch.jobs.selftest import BOUNDS, CONDITIONS, QUICK_SIZE, computed_scene, photograph
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.light import unchanged
from panostitch.model.panorama import Panorama, Plan
from panostitch.model.photo import grey_of
from panostitch.options import Options, OutputOptions
from panostitch.runtime.executor import Executor
from panostitch.synthetic.scene import procedural_texture
from panostitch.synthetic.score import score

Floats = NDArray[np.float64]

SIZE = (96, 64)  # px of the picture that is written
LOSSY = {"JPEG": 6, "WEBP": 6, "JPEG2000": 6}  # grey levels by which a smooth picture may change; others keep every one
TEXTURE, SEED = (512, 256), 7  # px
FEATURES, FEWEST = 200, 50  # key points asked for, and found at least
PLAN = "pair"
STEP = 4  # px between those that are compared with the scene
FAITHFUL = 2.0  # grey levels, mean difference of panorama and scene: 0.7 seen, 30 if it were 8 px off


def coders_anew() -> str:
    """The line that repairs what pictures are encoded and decoded with."""
    return f"{anew(OPENCV)} && {anew('pillow')}"


def formats() -> Iterator[Check]:
    """Every format and depth: written and read again, or only read where panoramas are not written in it."""
    kinds = Image.registered_extensions()
    written = {
        (kinds.get(ext, ext), depth): ext for ext in EXTENSIONS for depth in (8, 16) if depth == 8 or ext in DEEP
    }
    only_read = {(kind, 8): "" for kind in FORMATS if (kind, 8) not in written}
    with tempfile.TemporaryDirectory(prefix="panostitch-doctor-") as folder:
        for (kind, depth), extension in {**written, **only_read}.items():
            name = f"{kind}, {depth} bits"
            trial = partial(_format, name, kind, depth, os.path.join(folder, f"{depth}{extension or '.picture'}"))
            yield tried("formats", name, trial, remedy=coders_anew())


def _format(name: str, kind: str, depth: int, path: str) -> Check:
    truth = _ramps(Region(0, 0, *SIZE)).pixels
    if path.endswith(".picture"):
        Image.fromarray(np.rint(truth).astype(np.uint8)).save(path, format=kind)
    else:
        plan = Plan(unchanged(0), 1, np.zeros((1, 1), np.int16), (), Region(0, 0, *SIZE), "", covered=True)
        picture = Panorama(Canvas("cylindrical", 100.0, (0.0, 0.0), SIZE), plan, _ramps)
        write_panorama(picture, path, OutputOptions(depth="16" if depth == 16 else "8"))
    photo = open_photo(path)
    pixels = photo.deep.read()[0] / 257 if depth == 16 and photo.deep else photo.source.read()[0]
    off = float(np.abs(pixels - (truth if depth == 16 else np.rint(truth))).max())
    if off > LOSSY.get(kind, 0.5):
        return Check(
            "formats", name, "failed", f"what is read is {off:.0f} grey levels off what was written", coders_anew()
        )
    return Check("formats", name, "ok", "read" if path.endswith(".picture") else "written and read")


def _ramps(region: Region) -> Layer:
    """Smooth colours, which tell each place of the picture apart."""
    y, x = np.mgrid[region.y : region.bottom, region.x : region.right].astype(np.float32)
    pixels = np.stack([40 + 1.5 * x, 40 + 2.0 * y, 230 - 0.5 * (x + y)], axis=-1)
    return Layer(region, pixels.astype(np.float32), np.ones(x.shape, bool))


def detectors() -> Iterator[Check]:
    """Each detector on a small picture. Values are key points."""
    grey = grey_of(procedural_texture(*TEXTURE, SEED))
    for name in DETECTORS:
        yield tried("detectors", name, partial(_detector, name, grey), remedy=anew(OPENCV))


def _detector(name: str, grey: NDArray[np.uint8]) -> Check:
    count = len(DETECTORS[name](grey, FEATURES).xy)
    if count < FEWEST:
        return Check("detectors", name, "failed", f"{count} key points only", anew(OPENCV), count)
    return Check("detectors", name, "ok", f"{count} key points", value=count)


def scene(run: Executor) -> Iterator[Check]:
    """A known scene: photographed, aligned, rendered, and compared with what it is."""
    remedy = "report it, with the output of `panostitch doctor --json`"
    cameras, photos = photograph(
        PLAN, replace(CONDITIONS, exposure_step=0.0, vignetting=0.0, noise=0.0), size=QUICK_SIZE, run=run
    )
    found: list[Panorama] = []

    def align() -> Check:
        alignment = pipeline.align(photos, Options(), run=run)
        error = score(cameras, alignment.cameras).rms
        found.append(pipeline.render(alignment, Options(), run=run))
        said = f"{len(alignment.photos)} of {len(photos)} photos, {error:.4f} px off the truth (rms)"
        good = error <= BOUNDS[PLAN] and not alignment.left_out
        return Check("self-check", "cameras", "ok" if good else "failed", said, "" if good else remedy, error)

    def picture() -> Check:
        off = _difference(found[0], cameras, run)
        good = off <= FAITHFUL
        said = f"{off:.2f} grey levels of 255 off the scene (mean)"
        return Check("self-check", "panorama", "ok" if good else "failed", said, "" if good else remedy, off)

    yield tried("self-check", "cameras", align, remedy=remedy)
    if found:
        yield tried("self-check", "panorama", picture, remedy=remedy)


def _difference(panorama: Panorama, cameras: list[Camera], run: Executor) -> float:
    """Mean difference in grey levels of a panorama and what the scene has there; the first photo joins their worlds."""
    assert panorama.alignment is not None
    pixels, mask = assemble(panorama, run=run)
    crop, texture = panorama.plan.crop, computed_scene(PLAN, cameras)
    y, x = (a.ravel() for a in np.mgrid[0 : crop.height : STEP, 0 : crop.width : STEP])
    turn = panorama.alignment.cameras[0].cam_from_world.T @ cameras[0].cam_from_world
    rays = panorama.canvas.rays(np.column_stack([x + crop.x, y + crop.y]).astype(np.float64)) @ turn
    at = texture.coordinates(rays).T[::-1]
    truth = np.column_stack(
        [map_coordinates(texture.texture[..., c].astype(np.float32), at, order=1) for c in range(3)]
    )
    return float(np.abs(truth - pixels[y, x])[mask[y, x] > 0].mean())
