"""A photo on the canvas: exact coordinates on a coarse grid, enlarged where they bend little, then one sampling."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.photo import Photo
from panostitch.runtime.cache import LastUsed

Floats = NDArray[np.float64]
Raster = tuple[NDArray[np.uint8] | NDArray[np.uint16], NDArray[np.uint8] | None]
Decoded = LastUsed[tuple[Raster, Camera]]

STEP = 16  # px between exact coordinates; between them a bilinear guess is off by some 0.02 px
OFF = 0.05  # px of the photo: where the guess would be off by more, every pixel has its exact coordinates
CHUNK = 8192  # px: OpenCV's remap takes no side of 32,767 or more
FOOTPRINT_STEP = 8  # px of the reduced canvas
TAPS = 4  # px to each side that the widest interpolation looks at
REDUCE_BELOW = 0.75  # photos are read reduced only where the canvas is coarser than this: reducing costs sharpness
CACHE_BYTES = 2 << 30
DEEP = np.float32(1 / 257)  # of 0..65535 to 0..255, the range of all pixels after the warp


def decoded_photos(budget: int = CACHE_BYTES) -> Decoded:
    """A memory for decoded photos, by their number, of so many bytes."""
    return LastUsed(budget, lambda entry: sum(a.nbytes for a in entry[0] if a is not None))


def read_for(photo: Photo, camera: Camera, canvas: Canvas) -> tuple[Raster, Camera]:
    """The photo's pixels at the size that this canvas needs, and the camera for that size."""
    scale = min(1.0, canvas.scale / camera.focal * _magnification(camera))
    raster = (photo.deep or photo.source).read(scale if scale < REDUCE_BELOW else 1.0)
    height, width = raster[0].shape[:2]
    return raster, camera.scaled((width, height))


def _magnification(camera: Camera) -> float:
    """Change of scale at the photo's centre beyond its focal length: 1 for a rotation, any for a plane."""
    middle = (np.array([camera.size], np.float64) - 1) / 2
    around = camera.rays(middle + np.array([[0, 0], [1, 0], [0, 1]]))
    if np.isclose(abs(np.linalg.det(camera.cam_from_world)), 1) and camera.focal > 1:
        return 1.0
    plane = around[:, :2] / around[:, 2:]
    return float(np.sqrt(abs(np.linalg.det(plane[1:] - plane[0]))))


@dataclass(frozen=True)
class Blocks:
    """The coarse grid over a region: its nodes are the centres of the canvas's 16 px blocks.

    One block lies beyond the region on each side: resize then needs no extrapolation, its rule for pixel centres is
    ours, and the answer is the same for every region.

    camera: the photo's
    region: what was asked for
    outer:  what the blocks cover
    seen:   (h, w, 2) px of the photo at the nodes
    known:  (h, w) which of them are finite
    bent:   (h, w) between which of them a bilinear guess will not do
    """

    camera: Camera
    canvas: Canvas
    region: Region
    outer: Region
    seen: Floats
    known: NDArray[np.bool_]
    bent: NDArray[np.bool_]

    @cached_property
    def plain(self) -> bool:
        """Whether all nodes are known, and a guess does between all of them."""
        return bool(self.known.all()) and not self.bent.any()

    @property
    def misses(self) -> bool:
        """Whether the photo surely shows nothing of the region."""
        if self.bent.any():
            return False
        seen = self.seen[self.known]
        return bool((seen < -1).all(0).any() or (seen > self.camera.size).all(0).any())

    @property
    def surely_inside(self) -> bool:
        """Whether every pixel of the region lies in the photo: what is bilinear lies between its nodes."""
        return self.plain and bool((self.seen >= 0.5).all() and (self.seen <= np.array(self.camera.size) - 1.5).all())

    @cached_property
    def coordinates(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
        """Where (x, y, each (h, w) px of the photo) each pixel of the region is seen, and where that is known."""
        seen = self.seen if self.plain else np.where(self.known[..., None], self.seen, -1e4)
        x, y = (self.enlarged(np.asarray(seen[:, :, k], np.float32)) for k in (0, 1))
        if self.plain:
            return x, y, np.ones(x.shape, bool)
        valid = np.asarray(self.enlarged(np.asarray(self.known, np.float32)) > 0.999)
        if self.bent.any():
            # bilinear as well: more than nothing in all blocks that have a bent node at a corner
            down, right = np.nonzero(self.enlarged(np.asarray(self.bent, np.float32)) > 0)
            at = np.column_stack([right + float(self.region.x), down + float(self.region.y)])
            exact = _project(self.camera, self.canvas, at)
            valid[down, right] = np.isfinite(exact).all(1)
            x[down, right], y[down, right] = np.where(valid[down, right, None], exact, -1e4).T
        return x, y, valid

    @property
    def window(self) -> Region:
        """The part of the photo that the region's pixels are made of; where it shows none of them, what is nearest."""
        if self.plain:
            low, high = self.seen.min((0, 1)), self.seen.max((0, 1))  # what is bilinear lies between its nodes
        else:
            x, y, valid = self.coordinates
            if not valid.any():
                return Region(0, 0, 1, 1)
            low, high = (np.array([end(x[valid]), end(y[valid])]) for end in (np.min, np.max))
        size = np.array(self.camera.size)
        left, top = (int(n) for n in np.clip(np.floor(low) - TAPS, 0, size - 1))
        right, bottom = (int(n) for n in np.clip(np.ceil(high) + TAPS + 1, 1, size))
        return Region(left, top, right - left, bottom - top)

    def part(self, region: Region) -> "Blocks":
        """The grid over a part of its region."""
        outer = region.grown(STEP, multiple=STEP)
        place = outer.divided(STEP).within(self.outer.divided(STEP))
        return replace(
            self, region=region, outer=outer, seen=self.seen[place], known=self.known[place], bent=self.bent[place]
        )

    def enlarged(self, nodes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values at the nodes (h, w) as values of the region's pixels, bilinear."""
        large = cv2.resize(nodes, (self.outer.width, self.outer.height))
        return np.asarray(large[self.region.within(self.outer)], np.float32)


def blocks(camera: Camera, canvas: Canvas, region: Region) -> Blocks:
    """Exact coordinates of a photo at the nodes over a region of the canvas."""
    outer = region.grown(STEP, multiple=STEP)
    wide = outer.grown(STEP)  # a ring of nodes more, which tells how much the coordinates bend
    columns = np.arange(wide.x, wide.right, STEP) + (STEP - 1) / 2
    rows = np.arange(wide.y, wide.bottom, STEP) + (STEP - 1) / 2
    nodes = _project_grid(camera, canvas, np.asarray(columns, float), np.asarray(rows, float))
    seen = nodes[1:-1, 1:-1]
    known = np.asarray(np.isfinite(seen).all(2))
    return Blocks(camera, canvas, region, outer, seen, known, _bent(nodes, camera))


def warp_and_place(
    raster: Raster, camera: Camera, canvas: Canvas, region: Region, *, interpolation: int
) -> tuple[Layer, NDArray[np.float32]]:
    """The part of a photo that falls into a region of the canvas, and where (h, w, 2) px of the photo that is."""
    pixels = np.empty((region.height, region.width, 3), np.float32)
    xy = np.empty((region.height, region.width, 2), np.float32)
    mask = np.empty((region.height, region.width), bool)
    for part in region.tiles(CHUNK):
        grid, place = blocks(camera, canvas, part), part.within(region)
        layer = sample(raster, grid, interpolation)
        pixels[place], mask[place] = layer.pixels, layer.mask
        xy[place] = np.stack(grid.coordinates[:2], axis=-1)
    return Layer(region, pixels, mask), xy


def sample(raster: Raster, grid: Blocks, interpolation: int) -> Layer:
    """A photo at the pixels of a grid's region, whose sides are at most `CHUNK`."""
    x, y, valid = grid.coordinates
    window = grid.window
    # not rounded to whole levels before the light is corrected, and OpenCV is quicker with floats
    part = np.asarray(raster[0][window.within(Region.of(raster[0]))], np.float32)
    origin = np.array([window.x, window.y], np.float32)
    pixels = np.asarray(
        cv2.remap(part, x - origin[0], y - origin[1], interpolation, borderMode=cv2.BORDER_REPLICATE), np.float32
    )
    if not grid.plain:
        pixels[~valid] = raster[0][0, 0]
    mask = valid if grid.surely_inside else valid & _between(x, grid.camera.size[0]) & _between(y, grid.camera.size[1])
    if raster[1] is not None:
        mask = mask & (cv2.remap(raster[1], x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) > 254)
    if raster[0].dtype == np.uint16:
        pixels *= DEEP
    return Layer(grid.region, pixels, mask)


def _between(x: NDArray[np.float32], side: int) -> NDArray[np.bool_]:
    return np.asarray(cv2.inRange(x, -0.5, side - 0.5) > 0)


def _bent(nodes: Floats, camera: Camera) -> NDArray[np.bool_]:
    """Nodes, but for the outermost, about which a bilinear guess is off, or not possible, in or near the photo.

    nodes: (h, w, 2) px of the photo. Half-way between two nodes the guess is off by an eighth of their second
    difference; the two directions add up.
    """
    middle = nodes[1:-1, 1:-1]
    with np.errstate(invalid="ignore"):
        down = np.abs(nodes[:-2, 1:-1] - 2 * middle + nodes[2:, 1:-1])
        right = np.abs(nodes[1:-1, :-2] - 2 * middle + nodes[1:-1, 2:])
        straight = ((down + right) / 8 <= OFF).all(2)
        size = np.array(camera.size)
        near = ((nodes >= -size / 2) & (nodes <= 1.5 * size)).all(2)
    around = cv2.dilate(np.asarray(near, np.uint8), np.ones((3, 3), np.uint8))[1:-1, 1:-1] > 0
    return np.asarray(around & ~straight)


def _project_grid(camera: Camera, canvas: Canvas, columns: Floats, rows: Floats) -> Floats:
    """Photo coordinates (h, w, 2) of canvas pixels on a grid of columns and rows; NaN where not seen."""
    x, y = np.meshgrid(columns, rows)
    return _project(camera, canvas, np.column_stack([x.ravel(), y.ravel()])).reshape(len(rows), len(columns), 2)


def _project(camera: Camera, canvas: Canvas, xy: Floats) -> Floats:
    """Photo coordinates (n, 2) of canvas pixels (n, 2); NaN where not seen."""
    with np.errstate(invalid="ignore"):
        return camera.project(canvas.rays(xy))


def footprints(cameras: Sequence[Camera], canvas: Canvas) -> tuple[tuple[Region, ...], ...]:
    """For each photo the regions of the canvas that hold it: one, or two where it crosses the edge of a full turn."""
    step = FOOTPRINT_STEP
    columns = np.arange(0, canvas.size[0] + step, step, dtype=float)
    rows = np.arange(0, canvas.size[1] + step, step, dtype=float)
    return tuple(_footprint(camera, canvas, columns, rows) for camera in cameras)


def _footprint(camera: Camera, canvas: Canvas, columns: Floats, rows: Floats) -> tuple[Region, ...]:
    seen = _project_grid(camera, canvas, columns, rows)
    margin = 2.0 * FOOTPRINT_STEP * camera.focal / canvas.scale * max(_magnification(camera), 1e-6)
    with np.errstate(invalid="ignore"):
        inside = np.asarray(((seen >= -margin) & (seen <= np.array(camera.size) + margin)).all(2))
    occupied = np.flatnonzero(np.diff(np.pad(inside.any(0), 1).astype(np.int8)))
    regions = []
    for first, behind in occupied.reshape(-1, 2):
        used = np.flatnonzero(inside[:, first:behind].any(1))
        x, y = int(columns[first]), int(rows[used[0]])
        right, bottom = int(columns[behind - 1]) + 1, int(rows[used[-1]]) + 1
        region = Region(x, y, right - x, bottom - y).grown(FOOTPRINT_STEP) & canvas.region
        if region:
            regions.append(region)
    return tuple(regions)
