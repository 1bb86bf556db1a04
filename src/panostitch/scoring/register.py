"""Where the pixels of a finished picture lie in a photo, with nothing known of how the picture was made.

Key points and a homography first; then a smooth map, a polynomial in the photo's own coordinates that patches all over
the photo are fitted by. It is too stiff to follow a seam: what the picture does suddenly stays visible against it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.errors import InputError
from panostitch.features import detect_one
from panostitch.geometry import homography
from panostitch.geometry.sampling import rescale
from panostitch.matching import match
from panostitch.model.canvas import Layer, Region
from panostitch.model.features import Features
from panostitch.model.photo import Photo
from panostitch.options import FeatureOptions, MatchingOptions
from panostitch.scoring import patches
from panostitch.scoring.patches import HALF
from panostitch.synthetic.render import ArraySource

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Pixels = NDArray[np.uint8]

PHOTO_MEGAPIXELS, PHOTO_POINTS = 0.6, 2000  # of a photo, for its key points
MOST_MEGAPIXELS, MOST_POINTS = 12.0, 20_000  # of the picture
ROUGH = 0.03  # of the photo's diagonal: a homography need not be better, the projection bends the photo
FEWEST = 20  # matches that agree, below which the picture does not show the photo
PIECES = 2  # of a photo that lies across the edge of a full turn
DEGREES = (2, 3, 3)  # of the polynomial: by key points, then by patches twice; more of it would follow a seam
POINTS_FOR_A_TERM = 3  # at least
ROUNDS = 10  # of weighted least squares
TIGHT = 0.3  # px, width of the weights at least
PATCH_STEP = 32  # px of the picture between patches
REACH = 16  # px to which they are sought
BEYOND = 48  # px by which a map is believed beyond what it was fitted to
GRID = 8  # px between exact coordinates
REDUCE_BELOW = 0.75  # photos are read reduced where the picture is coarser than this


@dataclass(frozen=True)
class SmoothMap:
    """From picture px to photo px.

    photo_from_picture: (3, 3) homography
    terms: (m, 2) px of the photo that each power of its coordinates adds
    size:  (width, height) px of the photo
    hull:  (k, 2) corners, in the picture, of the convex part in which the map is known
    """

    photo_from_picture: Floats
    terms: Floats
    size: tuple[int, int]
    hull: Floats

    def __call__(self, xy: Floats) -> Floats:
        """Picture px (n, 2) in the photo; NaN behind the horizon."""
        flat = homography.apply(self.photo_from_picture, xy)
        return np.asarray(flat + _powers(flat, self.size, len(self.terms)) @ self.terms)

    @property
    def scale(self) -> float:
        """Px of the photo in a px of the picture, in the middle of what is known."""
        middle = self.hull.mean(0)
        around = self(middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
        return float(np.sqrt(abs(np.linalg.det(around[1:] - around[0]))))

    @property
    def place(self) -> Region:
        """The part of the picture in which the map is known."""
        x, y = np.floor(self.hull.min(0)).astype(int)
        right, bottom = np.ceil(self.hull.max(0)).astype(int) + 1
        return Region(int(x), int(y), int(right - x), int(bottom - y))

    def scaled(self, size: tuple[int, int]) -> "SmoothMap":
        """The map into the same photo at another size."""
        resize = _resize(self.size, size)
        terms = self.terms * (np.array(size) / self.size)
        return replace(self, photo_from_picture=resize @ self.photo_from_picture, terms=terms, size=size)

    def from_resized(self, old: tuple[int, int], new: tuple[int, int]) -> "SmoothMap":
        """The map from the picture at another size (width, height) px."""
        hull = rescale(self.hull, np.array(new) / old)
        return replace(self, photo_from_picture=self.photo_from_picture @ _resize(new, old), hull=hull)


def _resize(old: tuple[int, int], new: tuple[int, int]) -> Floats:
    """From the px of a picture to those of the same one at another size (3, 3)."""
    first, (x, y) = rescale(np.zeros(2), np.array(new) / old), np.array(new) / old
    return np.array([[x, 0, first[0]], [0, y, first[1]], [0, 0, 1]])


def register(picture: Pixels, photos: Sequence[Photo]) -> list[tuple[int, SmoothMap]]:
    """Where each photo lies in a picture (h, w, 3): none, one or more maps each, as (photo, map)."""
    as_photo = Photo("the picture", picture.shape[1::-1], ArraySource(picture))
    typical = float(np.median([photo.megapixels for photo in photos]))
    larger = max(1.0, as_photo.megapixels / typical)
    megapixels = min(MOST_MEGAPIXELS, PHOTO_MEGAPIXELS * larger)
    points = min(MOST_POINTS, int(PHOTO_POINTS * larger))
    whole = detect_one(as_photo, FeatureOptions(work_megapixels=megapixels, max_features=points))
    found = []
    for n, photo in enumerate(photos):
        try:
            own = detect_one(photo, FeatureOptions(work_megapixels=PHOTO_MEGAPIXELS, max_features=PHOTO_POINTS))
        except InputError:  # the programs that are judged have said so
            continue
        found += [(n, refined) for rough in _rough_maps(whole, own, photo.size)
                  if (refined := _refined(rough, picture, photo))]  # fmt: skip
    return found


def resized(pixels: Pixels, size: tuple[int, int]) -> Pixels:
    """A picture (h, w) or (h, w, 3) at another size (width, height) px."""
    smaller = size[0] < pixels.shape[1]
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA if smaller else cv2.INTER_CUBIC), np.uint8)


def _rough_maps(whole: Features, own: Features, size: tuple[int, int]) -> list[SmoothMap]:
    """Maps of degree DEGREES[0] by key points; several where the photo comes in pieces."""
    options = MatchingOptions(matcher="brute")
    (putative,) = match([whole, own], [(0, 1)], options)
    here, there = (f.xy[putative.pairs[:, k]].astype(np.float64) for k, f in enumerate((whole, own)))
    maps: list[SmoothMap] = []
    for _ in range(PIECES):
        found = homography.estimate(here, there, threshold=ROUGH * float(np.hypot(*size)), seed=options.seed)
        if found is None or found[1].sum() < FEWEST or not _sane(found[0], here[found[1]]):
            break
        inliers = found[1]
        maps.append(_fitted(found[0], here[inliers], there[inliers], size, DEGREES[0]))
        here, there = here[~inliers], there[~inliers]
    return maps


def _sane(photo_from_picture: Floats, xy: Floats) -> bool:
    """Whether the map is no mirror and does not fold among these points (n, 2)."""
    seen = homography.apply(photo_from_picture, xy)
    depth = xy @ photo_from_picture[2, :2] + photo_from_picture[2, 2]
    return bool(np.isfinite(seen).all() and (np.linalg.det(photo_from_picture) / depth**3 > 0).all())


def _powers(xy: Floats, size: tuple[int, int], count: int) -> Floats:
    """The first `count` products (n, count) of powers of x and y, which run from -1 to 1 over the photo."""
    u, v = ((xy + 0.5) / size * 2 - 1).T
    exponents = ((total - k, k) for total in range(max(DEGREES) + 1) for k in range(total + 1))
    return np.column_stack([u**a * v**b for (a, b), _ in zip(exponents, range(count), strict=False)])


def _fitted(photo_from_picture: Floats, here: Floats, there: Floats, size: tuple[int, int], degree: int) -> SmoothMap:
    """The map of this degree, or as much of it as so many points allow, that most of the points agree on."""
    while degree and (degree + 1) * (degree + 2) // 2 * POINTS_FOR_A_TERM > len(here):
        degree -= 1
    flat = homography.apply(photo_from_picture, here)
    design = _powers(flat, size, (degree + 1) * (degree + 2) // 2)
    wanted = there - flat
    weight = np.ones(len(here))
    for _ in range(ROUNDS):
        root = np.sqrt(weight)[:, None]
        terms = np.asarray(np.linalg.lstsq(design * root, wanted * root, rcond=None)[0], np.float64)
        off = np.hypot(*(wanted - design @ terms).T)
        width = max(TIGHT, 1.5 * float(np.median(off)))
        weight = 1 / (1 + (off / width) ** 2)
    near = here[off <= 4 * width].astype(np.float32)
    return SmoothMap(photo_from_picture, terms, size, np.asarray(cv2.convexHull(near)[:, 0], np.float64))


def _refined(rough: SmoothMap, picture: Pixels, photo: Photo) -> SmoothMap | None:
    """The map by patches all over the photo; None where too few are found."""
    raster = photo.source.read()
    refined = rough
    for degree in DEGREES[1:]:
        layer_place = refined.place.grown(BEYOND) & Region.of(picture)
        here, shift = _measured(refined, picture, raster, layer_place)
        if len(here) < FEWEST:
            return None
        refined = _fitted(rough.photo_from_picture, here, refined(here + shift), photo.size, degree)
    return refined


def _measured(
    known: SmoothMap, picture: Pixels, raster: tuple[Pixels, Pixels | None], place: Region
) -> tuple[Floats, Floats]:
    """Patches (n, 2) px of the picture that are found in the photo, and how far (n, 2) they are off."""
    layer = seen_in(known, raster, place)
    own = picture[place.within(Region.of(picture))].astype(np.float32)
    far = HALF + REACH
    x, y = np.meshgrid(*(np.arange(far, n - far, PATCH_STEP) for n in (place.width, place.height)))
    centres = np.column_stack([x.ravel(), y.ravel()])
    if not len(centres):
        return np.zeros((0, 2)), np.zeros((0, 2))
    found = patches.find(patches.softened(own), patches.softened(layer.pixels), layer.mask, centres, REACH)
    return np.asarray(centres[found.known] + [place.x, place.y], np.float64), found.shift[found.known]


def seen_in(known: SmoothMap, raster: tuple[Pixels, Pixels | None], region: Region) -> Layer:
    """A photo as it lies in a region of the picture, where the map is known."""
    columns, rows = (np.arange(-GRID, n + 2 * GRID, GRID) for n in (region.width, region.height))
    x, y = np.meshgrid(columns + region.x, rows + region.y)
    with np.errstate(invalid="ignore"):
        nodes = known(np.column_stack([x.ravel(), y.ravel()]).astype(np.float64)).reshape(*x.shape, 2)
    nodes = np.where(np.isfinite(nodes), nodes, -1e4).astype(np.float32)
    # the map from pixels to the grid: node 1 is the region's first pixel
    across, down = np.meshgrid(np.arange(region.width) / GRID + 1, np.arange(region.height) / GRID + 1)
    at = cv2.remap(nodes, across.astype(np.float32), down.astype(np.float32), cv2.INTER_LINEAR)
    there_x, there_y = at[..., 0], at[..., 1]
    pixels = cv2.remap(raster[0], there_x, there_y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    width, height = raster[0].shape[1::-1]
    mask = (at >= 0).all(-1) & (at <= np.array([width - 1, height - 1])).all(-1) & _near_hull(known, region)
    if raster[1] is not None:
        mask &= cv2.remap(raster[1], there_x, there_y, cv2.INTER_LINEAR) > 254
    return Layer(region, pixels.astype(np.float32), mask)


def _near_hull(known: SmoothMap, region: Region) -> Booleans:
    """Which pixels (h, w) of a region lie in the part in which the map is known, or BEYOND next to it."""
    drawn = np.ones((region.height + 2 * BEYOND, region.width + 2 * BEYOND), np.uint8)
    corners = np.rint(known.hull - [region.x - BEYOND, region.y - BEYOND]).astype(np.int32)
    cv2.fillConvexPoly(drawn, corners, 0)
    far = cv2.distanceTransform(drawn, cv2.DIST_L2, cv2.DIST_MASK_5)
    return np.asarray(far[BEYOND:-BEYOND, BEYOND:-BEYOND] <= BEYOND)
