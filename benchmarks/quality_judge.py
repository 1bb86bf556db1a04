"""The judge of `quality.py`: a finished equirectangular picture beside the scene that was photographed.

Where a picture lies on the sphere is what its program says (scale, place, cameras), made exact by the turn and the
scale with which the scene is most like it. Nothing else is fitted: what lies in a wrong place within the picture stays
there. Then the scene is rendered at the picture's own pixels, so that no picture is ever resampled.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from panostitch.geometry import rotation
from panostitch.model.camera import Camera
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import Scene
from panostitch.synthetic.score import View, score

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Picture = NDArray[np.uint8]

BLURS = (4.0, 1.0)  # px of the picture, deviation: coarse to fine
SAMPLES = 60_000  # pixels by which a picture is registered
SEED = 3
STEP = 0.5  # px, for derivatives; OpenCV reads pictures at 32nds of a px, which averages out
ROUNDS = 8  # at most, at each blur
SETTLED = 1e-3  # px
ROWS = 64  # rendered at once
MARGIN = 8  # px of a photo, and of a picture, along the edge of what is judged
SSIM_BLUR = 1.5  # px (Wang et al. 2004)
AROUND = 20.0  # px, deviation: what is brighter or darker over so large a part of a picture is no matter of sharpness


@dataclass(frozen=True)
class Place:
    """Where an equirectangular picture lies on the sphere.

    size:   (width, height) px
    scale:  px per radian
    middle: (x, y) px of longitude and latitude 0, which may lie outside
    turn:   (3, 3) scene_from_picture
    """

    size: tuple[int, int]
    scale: float
    middle: tuple[float, float]
    turn: Floats

    def rays(self, xy: Floats) -> Floats:
        """Rays (n, 3) of the scene at px (n, 2)."""
        longitude, latitude = ((xy - self.middle) / self.scale).T
        ahead = np.cos(latitude)
        seen = np.column_stack([ahead * np.sin(longitude), np.sin(latitude), ahead * np.cos(longitude)])
        return np.asarray(seen @ self.turn.T)

    def pixels(self, rays: Floats) -> Floats:
        """The px (n, 2) at which rays (n, 3) of the scene are seen; of columns a full turn apart the first."""
        x, y, z = (rays @ self.turn).T
        across = np.arctan2(x, z) * self.scale + self.middle[0]
        across = (across + 0.5) % (2 * np.pi * self.scale) - 0.5
        return np.column_stack([across, np.arctan2(y, np.hypot(x, z)) * self.scale + self.middle[1]])

    def rows(self, top: int, bottom: int) -> "Place":
        """The place of some rows of the picture."""
        return replace(self, size=(self.size[0], bottom - top), middle=(self.middle[0], self.middle[1] - top))

    @property
    def grid(self) -> Floats:
        """All pixels (n, 2), row by row."""
        x, y = np.meshgrid(*map(np.arange, self.size))
        return np.column_stack([x.ravel(), y.ravel()]).astype(np.float64)


@dataclass(frozen=True)
class Finished:
    """A program's picture.

    pixels:  (h, w, 3)
    mask:    (h, w), where it shows something
    place:   where the program says that it is; `turn` counts for nothing
    cameras: of each photo in the program's own world; None where it was left out
    """

    pixels: Picture
    mask: Booleans
    place: Place
    cameras: tuple[View | None, ...]


@dataclass(frozen=True)
class Quality:
    """A picture beside the scene.

    psnr:      dB on 0..255
    ssim:      mean structural similarity
    sharpness: energy of the gradient over the scene's, in a picture that is everywhere as bright as it
    cameras:   px, rms error of the cameras, which needs no picture
    photos:    how many are in it
    scale:     px of the picture for a px in the middle of a photo
    """

    psnr: float
    ssim: float
    sharpness: float
    cameras: float
    photos: int
    scale: float


def judge(scene: Scene, cameras: Sequence[Camera], pictures: dict[str, Finished]) -> dict[str, Quality]:
    """Pictures by different programs of one plan's photos beside the scene.

    Each is compared in the part of it that all pictures show that have the most photos in them: those with all photos
    in the same part, and one that has left photos out in as much of that as it has.
    """
    places = {name: register(scene, cameras, picture) for name, picture in pictures.items()}
    scores = {name: score(cameras, picture.cameras) for name, picture in pictures.items()}
    counts = {name: len(cameras) - len(result.missing) for name, result in scores.items()}
    largest = [name for name, count in counts.items() if count == max(counts.values())]
    found = {}
    for name, picture in pictures.items():
        rays = places[name].rays(places[name].grid)
        common = photographed(cameras, rays)
        for other in {name, *largest}:
            common &= shown(eroded(pictures[other].mask), places[other].pixels(rays))
        alike = compare(picture.pixels, render(scene, places[name]), common.reshape(picture.mask.shape))
        found[name] = Quality(*alike, scores[name].rms, counts[name], places[name].scale / cameras[0].focal)
    return found


# ---- where a picture lies


def register(scene: Scene, cameras: Sequence[Camera], picture: Finished) -> Place:
    """The place of a picture with the turn and the scale at which it is most like the scene."""
    place = replace(picture.place, turn=stated_turn(cameras, picture.cameras))
    y, x = np.nonzero(eroded(picture.mask))
    chosen = np.random.default_rng(SEED).choice(len(x), min(SAMPLES, len(x)), replace=False)
    xy = np.column_stack([x, y])[np.sort(chosen)].astype(np.float64)
    xy = xy[photographed(cameras, place.rays(xy))]
    for blur in BLURS:
        place = refined(scene, picture.pixels, place, xy, blur)
    return place


def stated_turn(true: Sequence[Camera], found: Sequence[View | None]) -> Floats:
    """The turn (3, 3) from a program's world to the scene's in which its photos look where they truly look."""
    total = np.zeros((3, 3))
    for camera, other in zip(true, found, strict=True):
        if other:
            points = camera.corners * 0.5 + np.array(camera.size) / 4  # half-way to the middle
            rays, theirs = camera.rays(points), other.rays(points)
            total += (rays / np.linalg.norm(rays, axis=1, keepdims=True)).T @ (
                theirs / np.linalg.norm(theirs, axis=1, keepdims=True)
            )
    return rotation.nearest(total)


def refined(scene: Scene, pixels: Picture, start: Place, xy: Floats, blur: float) -> Place:
    """The place at which the blurred scene is most like the blurred picture, by px (n, 2) of it."""
    texture = blurred(np.asarray(scene.texture), blur * scene.texture.shape[1] / (2 * np.pi * start.scale))
    column, row = xy.T.astype(int)
    seen = standardised(blurred(pixels, blur)[row, column])

    def moved(place: Place, change: Floats) -> Place:
        """Turned by radians about three axes, and enlarged by a share."""
        return replace(place, scale=place.scale * np.exp(change[3]), turn=place.turn @ rotation.exp(change[:3]))

    def there(place: Place) -> Floats:
        x, y = scene.coordinates(place.rays(xy)).T.astype(np.float32)
        # remap takes no more than 32767 rows
        x, y = (np.resize(v, (-(-len(v) // 256), 256)) for v in (x, y))
        found = cv2.remap(texture, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        return standardised(found.ravel()[: len(xy)])

    place = start
    for _ in range(ROUNDS):  # Gauss and Newton
        steps = np.eye(4) * STEP / place.scale
        slopes = [(there(moved(place, step)) - there(moved(place, -step))) / 2 for step in steps]
        change = np.linalg.lstsq(np.column_stack(slopes), seen - there(place))[0] * STEP
        place = moved(place, change / place.scale)
        if np.abs(change).max() < SETTLED:
            break
    return place


def blurred(picture: NDArray[np.generic], deviation: float) -> NDArray[np.float32]:
    """Grey values (h, w) of a picture (h, w, 3), blurred."""
    grey = cv2.cvtColor(picture.astype(np.float32), cv2.COLOR_RGB2GRAY)
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), deviation), np.float32)


def standardised(values: NDArray[np.float32]) -> Floats:
    """Values (n,) of mean 0 and deviation 1: how bright and how contrasty a picture is does not move it."""
    return np.asarray((values - values.mean()) / values.std(), np.float64)


# ---- what all of them show


def eroded(mask: Booleans) -> Booleans:
    """Where (h, w) a mask is true, and all around by MARGIN."""
    kernel = np.ones((2 * MARGIN + 1,) * 2, np.uint8)
    return cv2.erode(mask.astype(np.uint8), kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0


def shown(mask: Booleans, xy: Floats) -> Booleans:
    """Which px (n, 2) lie in a mask (h, w)."""
    column, row = np.rint(xy).T.astype(int)
    inside = (column >= 0) & (column < mask.shape[1]) & (row >= 0) & (row < mask.shape[0])
    inside[inside] = mask[row[inside], column[inside]]
    return np.asarray(inside)


def photographed(cameras: Sequence[Camera], rays: Floats) -> Booleans:
    """Which rays (n,) of unit length lie well inside a photo."""
    seen = np.zeros(len(rays), bool)
    for camera in cameras:
        ahead, corners = camera.cam_from_world[2], camera.rays(camera.corners)
        farthest = (corners @ ahead / np.linalg.norm(corners, axis=1)).min()
        index = np.flatnonzero(~seen & (rays @ ahead > farthest))
        xy = camera.project(rays[index])
        seen[index] = ((xy >= MARGIN) & (xy <= np.array(camera.size) - 1 - MARGIN)).all(1)
    return seen


# ---- how alike they are


def render(scene: Scene, place: Place) -> Picture:
    """The picture (h, w, 3) as it ought to be. `photograph` asks no more of a camera than its size and its rays."""
    height = place.size[1]
    bands = [place.rows(top, min(top + ROWS, height)) for top in range(0, height, ROWS)]
    return np.concatenate([photograph(scene, band) for band in bands])


def compare(pixels: Picture, truth: Picture, where: Booleans) -> tuple[float, float, float]:
    """PSNR (dB), SSIM and sharpness of a picture; its channels get the factor and the offset that suit it best."""
    found = np.dstack([levelled(pixels[..., c], truth[..., c], where) for c in range(3)])
    error = ((found - truth)[where] ** 2).mean()
    own_grey, grey, true_grey = (cv2.cvtColor(a.astype(np.float32), cv2.COLOR_RGB2GRAY) for a in (pixels, found, truth))
    _, ssim = structural_similarity(
        grey, true_grey, data_range=255, gaussian_weights=True, sigma=SSIM_BLUR, use_sample_covariance=False, full=True
    )
    sharpness = energy(evened(own_grey, true_grey, where))[where].sum() / energy(true_grey)[where].sum()
    return float(10 * np.log10(255**2 / max(error, 1e-12))), float(ssim[where].mean()), float(sharpness)


def levelled(channel: Picture, truth: Picture, where: Booleans) -> Floats:
    """A channel (h, w), as bright and as contrasty as the truth: that of the whole is a matter of taste."""
    value, aim = channel[where].astype(np.float64), truth[where].astype(np.float64)
    gain = ((value - value.mean()) * (aim - aim.mean())).mean() / value.var()
    return np.asarray((channel - value.mean()) * gain + aim.mean())


def evened(grey: NDArray[np.float32], truth: NDArray[np.float32], where: Booleans) -> NDArray[np.float32]:
    """Grey values (h, w) made everywhere as bright as the truth around: a gradient grows with a gain, sharpness not."""
    near, true_near = (cv2.GaussianBlur(np.where(where, a, np.float32(0)), (0, 0), AROUND) for a in (grey, truth))
    return np.asarray(grey * (true_near + 1) / (near + 1), np.float32)


def energy(grey: NDArray[np.float32]) -> Floats:
    """Squares (h, w) of the gradient."""
    return np.asarray(cv2.Sobel(grey, cv2.CV_64F, 1, 0) ** 2 + cv2.Sobel(grey, cv2.CV_64F, 0, 1) ** 2)
