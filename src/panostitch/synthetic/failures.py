"""Photos that cannot be stitched, each kind for a known cause: what is said of them can be held against the truth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.model.photo import Photo, Pixels
from panostitch.synthetic.render import ArraySource, photograph
from panostitch.synthetic.rig import rig, step_for_overlap
from panostitch.synthetic.scene import Scene, sphere_scene
from panostitch.synthetic.textures import procedural_texture

CASES = 10  # of each cause; the second half is like the first one, of other scenes

SIZE = (480, 360)
HFOV = np.deg2rad(50)
OVERLAP = 0.5  # of photos that do not fail for want of it
NOISE = 1.5  # grey levels, standard deviation
GRAIN = 9.0  # the same in photos of a pattern: what is left to tell one tile from another
TEXTURE = (2400, 1200)

SMALL_OVERLAPS = (0.03, 0.04, 0.045, 0.025, 0.035)
EXPOSURES = (8.0, -12.0, 7.5, -13.0, 7.0)  # EV from the other photos: burnt out, or lost in the dark
DEFOCUS = (6.0, 8.0, 10.0, 7.0, 0.0)  # px, deviation of the blur of the photo; 0 is a shake
SHAKE = 60  # px
PERIODS = (45, 60, 75, 50, 40)  # px of the photo after which a pattern repeats
SUBJECTS = (4, 3)  # columns and rows of things that move, over the part that both photos show
STRIDE = 40.0  # px, deviation of where each of them goes between the photos
COVERED = 0.95  # of each side of a cell of the grid is covered by its subject
DEPTHS = (26.0, 34.0, 42.0, 30.0, 38.0)  # px, deviation of the shift between two points of view


@dataclass(frozen=True)
class Planted:
    """Photos of which the last one belongs to no panorama, and why not."""

    cause: str
    photos: tuple[Photo, ...]

    @property
    def failing(self) -> str:
        """Name of the photo that fails."""
        return self.photos[-1].name


def _of(values: Sequence[float], case: int) -> float:
    return values[case % len(values)]


@lru_cache(maxsize=3)
def _scene(seed: int) -> Scene:
    return sphere_scene(procedural_texture(*TEXTURE, seed=seed))


def _row(scene: Scene, steps: Sequence[float], exposures: Sequence[float], rng: np.random.Generator) -> list[Pixels]:
    """Photos of a camera that turns by these steps (radians), with exposures in EV."""
    cameras = rig(np.cumsum(steps), size=SIZE, hfov=HFOV)
    return [
        photograph(scene, camera, exposure=exposure, noise=NOISE, rng=rng, supersample=1)
        for camera, exposure in zip(cameras, exposures, strict=True)
    ]


def _good_row(case: int, rng: np.random.Generator, *, last: float = OVERLAP, exposure: float = 0.0) -> list[Pixels]:
    """Three photos in a row; the last one overlaps the second one this much, and is exposed so many EV longer."""
    steps = [rng.uniform(-3, 3), step_for_overlap(OVERLAP, HFOV), step_for_overlap(last, HFOV)]
    return _row(_scene(case), steps, [0.0, 0.0, exposure], rng)


def _no_texture(case: int, rng: np.random.Generator) -> list[Pixels]:
    """A plain wall, lit from one side."""
    photos = _good_row(case, rng)
    width, height = SIZE
    x, y = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    slope = rng.uniform(-25, 25, 2)
    wall = rng.uniform(60, 200, 3) + (slope[0] * x + slope[1] * y)[..., None]
    return [*photos[:2], _noisy(wall, rng)]


def _small_overlap(case: int, rng: np.random.Generator) -> list[Pixels]:
    """The camera was turned too far."""
    return _good_row(case, rng, last=_of(SMALL_OVERLAPS, case))


def _repeated_pattern(case: int, rng: np.random.Generator) -> list[Pixels]:
    """A wall of tiles, each like the others, from straight before it; the camera moves along."""
    period, (width, height) = round(_of(PERIODS, case)), SIZE
    tile = procedural_texture(8 * period, 4 * period, seed=case)[: 4 * period, : 4 * period].astype(np.float64)
    repeats = (height // period + 2, width // period + 2, 1)
    wall = np.tile(cv2.resize(tile, (period, period), interpolation=cv2.INTER_AREA), repeats)
    starts = rng.integers(0, period, (2, 2))
    return [_noisy(wall[y : y + height, x : x + width], rng, GRAIN) for x, y in starts]


def _blur(case: int, rng: np.random.Generator) -> list[Pixels]:
    """Out of focus, or shaken."""
    *others, last = _good_row(case, rng)
    defocus, picture = _of(DEFOCUS, case), last.astype(np.float64)
    soft = cv2.GaussianBlur(picture, (0, 0), defocus) if defocus else cv2.blur(picture, (SHAKE, 3))
    return [*others, _noisy(soft, rng)]


def _exposure(case: int, rng: np.random.Generator) -> list[Pixels]:
    """Burnt out, or lost in the dark."""
    return _good_row(case, rng, exposure=_of(EXPOSURES, case))


def _moving_subject(case: int, rng: np.random.Generator) -> list[Pixels]:
    """A crowd fills the overlap, and everybody goes his own way between the photos."""
    left, right = _row(_scene(case), [rng.uniform(-3, 3), step_for_overlap(OVERLAP, HFOV)], [0.0, 0.0], rng)
    crowd = procedural_texture(800, 400, seed=100 + case)
    width, height = (round(SIZE[0] * OVERLAP) // SUBJECTS[0], SIZE[1] // SUBJECTS[1])
    for column in range(SUBJECTS[0]):
        for row in range(SUBJECTS[1]):
            wide, high = round(width * COVERED), round(height * COVERED)
            x, y = rng.integers(0, 800 - wide), rng.integers(0, 400 - high)
            subject = crowd[y : y + high, x : x + wide]
            for photo, shift in ((left, SIZE[0] - SUBJECTS[0] * width), (right, 0)):
                at = np.rint(rng.normal([column * width + shift, row * height], STRIDE)).astype(int)
                _paste(photo, subject, at)
    return [left, right]


def _paste(photo: Pixels, subject: Pixels, at: NDArray[np.int_]) -> None:
    """Put a subject into a photo, its top left corner at (x, y) or as near as the photo allows."""
    high, wide = subject.shape[:2]
    x, y = np.clip(at, 0, [photo.shape[1] - wide, photo.shape[0] - high])
    photo[y : y + high, x : x + wide] = subject


def _parallax(case: int, rng: np.random.Generator) -> list[Pixels]:
    """Foliage near and far, from two places beside each other: every point shifts by its own depth."""
    (photo,) = _row(_scene(case), [rng.uniform(-3, 3)], [0.0], rng)
    width, height = SIZE
    depth = cv2.GaussianBlur(rng.standard_normal((height, width)), (0, 0), 28)
    shift = depth / depth.std() * _of(DEPTHS, case)
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    moved = cv2.remap(photo, x + shift.astype(np.float32), y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    return [photo, _noisy(moved.astype(np.float64), rng)]


def _different_scene(case: int, rng: np.random.Generator) -> list[Pixels]:
    """A photo of somewhere else."""
    return [*_good_row(case, rng)[:2], *_row(_scene(50 + case), [rng.uniform(-3, 3)], [0.0], rng)]


# Every cause that can be planted.
FAILURES: dict[str, Callable[[int, np.random.Generator], list[Pixels]]] = {
    "no texture": _no_texture,
    "too little overlap": _small_overlap,
    "repeated pattern": _repeated_pattern,
    "blur": _blur,
    "exposure": _exposure,
    "moving subject": _moving_subject,
    "parallax": _parallax,
    "different scene": _different_scene,
}


def plant(cause: str, case: int) -> Planted:
    """Photos that fail for a cause; the case (0 to CASES - 1) is another scene, and milder or worse."""
    rng = np.random.default_rng([case, *cause.encode()])
    pixels = FAILURES[cause](case, rng)
    photos = tuple(Photo(f"photo_{n:02d}", SIZE, ArraySource(p)) for n, p in enumerate(pixels, start=1))
    return Planted(cause, photos)


def _noisy(picture: NDArray[Any], rng: np.random.Generator, noise: float = NOISE) -> Pixels:
    return np.clip(np.rint(picture + rng.normal(0, noise, picture.shape)), 0, 255).astype(np.uint8)
