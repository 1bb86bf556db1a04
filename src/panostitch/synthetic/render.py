"""Photographs a scene. Shares no code with `compositing.warp`, which it is there to prove.

Every pixel goes through the camera exactly; the texture is read by cubic splines in float64 coordinates.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, spline_filter

from panostitch.model.camera import Camera
from panostitch.model.photo import Photo, Pixels
from panostitch.runtime.executor import Executor, serial
from panostitch.synthetic.scene import Scene

Floats = NDArray[np.float64]

# encoded value = linear light ** (1 / GAMMA)
GAMMA = 2.2
# a cubic spline forgets the edge of its data by 0.27 a pixel: 16 px leave nothing of it
SPLINE_MARGIN = 16
MOST_SAMPLES = 8
FULL_FRAME_DIAGONAL = 43.27  # mm of the sensor that the photos' metadata tell of
LENGTH_DECIMALS = 1  # of mm, to which metadata state a focal length


@dataclass(frozen=True)
class ArraySource:
    """The pixels of a photo that exists in memory only: (h, w, 3) RGB."""

    pixels: Pixels

    def read(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """The photo at `scale` <= 1, area averaged; opaque."""
        if scale == 1.0:
            return self.pixels, None
        height, width = self.pixels.shape[:2]
        size = max(1, round(width * scale)), max(1, round(height * scale))
        return np.asarray(cv2.resize(self.pixels, size, interpolation=cv2.INTER_AREA), np.uint8), None


def photograph(
    scene: Scene,
    camera: Camera,
    *,
    exposure: float = 0.0,
    vignetting: float = 0.0,
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
    supersample: int | None = None,
) -> Pixels:
    """The photo (h, w, 3) RGB that a camera takes of a scene.

    exposure:    EV; +1 doubles the linear light
    vignetting:  share of the light that is lost in the corners, falling with the square of the radius
    noise:       standard deviation in grey levels, added to the encoded values; needs `rng`
    supersample: samples per pixel and axis; by default as many as the texture is finer than the photo
    """
    if noise and rng is None:
        raise ValueError("noise needs an rng")
    picture = _through_lens(scene, camera, supersample)
    light = 2.0**exposure * (1 - vignetting * _radius_square(camera.size))
    # a factor of the light is a factor of its power
    picture *= light[..., None] ** (1 / GAMMA)
    if noise and rng is not None:
        picture = np.clip(picture, 0, 255) + rng.normal(0.0, noise, picture.shape)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def photograph_plan(
    scene: Scene,
    cameras: Sequence[Camera],
    *,
    exposures: Sequence[float] | None = None,
    vignetting: float = 0.0,
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
    supersample: int | None = None,
    focal_known: bool = False,
    run: Executor = serial,
) -> list[Photo]:
    """Photos `photo_01`, `photo_02`, ... in memory; with `focal_known` they carry what EXIF tells of the focal length.

    The noise of a photo does not depend on how many threads take them.
    """
    dice = rng.spawn(len(cameras)) if rng else [None] * len(cameras)
    steps = exposures or [0.0] * len(cameras)

    def one(number: int) -> Photo:
        camera, light = cameras[number], {"exposure": steps[number], "vignetting": vignetting, "noise": noise}
        pixels = photograph(scene, camera, **light, rng=dice[number], supersample=supersample)
        length = focal_length(camera) if focal_known and scene.shape == "sphere" else None
        return Photo(
            f"photo_{number + 1:02d}",
            camera.size,
            ArraySource(pixels),
            focal=length * pixels_per_mm(camera.size) if length else None,
            lens=" ".join(["synthetic", *([f"{length:g} mm"] if length else [])]) if focal_known else "",
        )

    return list(run.map(one, range(len(cameras)), label="Photographing"))


def focal_length(camera: Camera) -> float:
    """What the metadata of a photo say, mm; rounded, as they are."""
    return round(camera.focal / pixels_per_mm(camera.size), LENGTH_DECIMALS)


def pixels_per_mm(size: tuple[int, int]) -> float:
    """Of the sensor that photos of a size (width, height) px are from."""
    return float(np.hypot(*size)) / FULL_FRAME_DIAGONAL


def _through_lens(scene: Scene, camera: Camera, supersample: int | None) -> Floats:
    """What the camera sees (h, w, 3), in 0..255, before exposure: the mean of the samples of each pixel."""
    width, height = camera.size
    samples = supersample or _samples_needed(scene, camera)
    offsets = (np.arange(samples) + 0.5) / samples - 0.5
    x, y = (a.ravel() for a in np.meshgrid(np.arange(width), np.arange(height)))
    pixels = np.column_stack([x, y]).astype(np.float64)
    shifts = np.array([(across, down) for down in offsets for across in offsets])
    points = np.stack([scene.coordinates(camera.rays(pixels + shift)) for shift in shifts])
    return np.asarray(_colours(scene, points.reshape(-1, 2)).reshape(-1, height, width, 3).mean(0))


def _colours(scene: Scene, xy: Floats) -> Floats:
    """Colours (n, 3) at texture px (n, 2), by cubic spline."""
    height, width = scene.texture.shape[:2]
    seen = np.ones(len(xy), bool)
    if scene.shape == "sphere":
        # count columns from the first pixel, so that a photo across the texture's edge is one piece
        xy[:, 0] = xy[0, 0] + (xy[:, 0] - xy[0, 0] + width / 2) % width - width / 2
    else:
        # NaN compares as beside the plane
        seen = (np.abs(xy - [(width - 1) / 2, (height - 1) / 2]) <= [width / 2, height / 2]).all(1)
    colours = np.tile(np.array(scene.background, np.float64), (len(xy), 1))
    if seen.any():
        colours[seen] = _spline(scene, xy[seen])
    return colours


def _spline(scene: Scene, xy: Floats) -> Floats:
    """The texture's cubic spline (n, 3) at px (n, 2), from the piece of it that these points span."""
    low = np.floor(xy.min(0)).astype(int) - SPLINE_MARGIN
    high = np.ceil(xy.max(0)).astype(int) + SPLINE_MARGIN + 1
    patch = scene.patch(range(low[0], high[0]), range(low[1], high[1]))
    at = (xy - low).T[::-1]
    channels = (spline_filter(patch[..., c], order=3, mode="mirror") for c in range(3))
    return np.column_stack([map_coordinates(channel, at, order=3, prefilter=False) for channel in channels])


def _samples_needed(scene: Scene, camera: Camera) -> int:
    """Samples per axis that keep fine texture from aliasing: texture px in a pixel of the photo, where most."""
    width, height = camera.size
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0, width - 1, 5), np.linspace(0, height - 1, 5)))
    pixels = np.column_stack([x, y])
    here = scene.coordinates(camera.rays(pixels))
    texture_height, texture_width = scene.texture.shape[:2]
    most = 1.0
    for step in ((1.0, 0.0), (0.0, 1.0)):
        move = scene.coordinates(camera.rays(pixels + step)) - here
        if scene.shape == "sphere":
            move[:, 0] = (move[:, 0] + texture_width / 2) % texture_width - texture_width / 2
            # near a pole a column is narrow on the sphere, and there is no more to see in it
            move[:, 0] *= np.cos((here[:, 1] + 0.5 - texture_height / 2) * np.pi / texture_height)
        most = max(most, float(np.hypot(*move.T).max()))
    # a texture just finer than the photo is still safe with one sample: its finest octave is weak
    return int(np.clip(np.ceil(most - 0.25), 1, MOST_SAMPLES))


def _radius_square(size: tuple[int, int]) -> Floats:
    """Square of the distance from the middle of the photo (h, w); 1 in the corners."""
    x, y = ((np.arange(n) - (n - 1) / 2) / max((n - 1) / 2, 0.5) for n in size)
    across, down = max(size[0] - 1, 1), max(size[1] - 1, 1)
    return np.asarray((x[None] ** 2 * across**2 + y[:, None] ** 2 * down**2) / (across**2 + down**2))
