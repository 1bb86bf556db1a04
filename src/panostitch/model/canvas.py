"""The canvas: where rays of the world become pixels of the panorama."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.projections import PROJECTIONS
from panostitch.geometry.sampling import rescale

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Region:
    """A rectangle of pixels, half open: x <= column < x + width. The one rectangle type."""

    x: int
    y: int
    width: int
    height: int

    @classmethod
    def of(cls, array: NDArray[np.generic]) -> "Region":
        """All of an array (h, w, ...)."""
        return cls(0, 0, array.shape[1], array.shape[0])

    @property
    def right(self) -> int:
        """First column behind the region."""
        return self.x + self.width

    @property
    def bottom(self) -> int:
        """First row behind the region."""
        return self.y + self.height

    @property
    def area(self) -> int:
        """Number of pixels."""
        return self.width * self.height

    def __and__(self, other: "Region") -> "Region":
        x, y = max(self.x, other.x), max(self.y, other.y)
        right, bottom = min(self.right, other.right), min(self.bottom, other.bottom)
        return Region(x, y, max(0, right - x), max(0, bottom - y))

    def __bool__(self) -> bool:
        return self.width > 0 and self.height > 0

    def within(self, outer: "Region") -> tuple[slice, slice]:
        """Rows and columns of this region in an array that holds `outer`."""
        return (
            slice(self.y - outer.y, self.bottom - outer.y),
            slice(self.x - outer.x, self.right - outer.x),
        )

    def moved(self, right: int) -> "Region":
        """The region so many pixels further right."""
        return Region(self.x + right, self.y, self.width, self.height)

    def tiles(self, width: int, height: int | None = None) -> list["Region"]:
        """This region cut into pieces of at most `width` x `height` (squares without it), row by row."""
        height = height or width
        return [
            Region(x, y, min(width, self.right - x), min(height, self.bottom - y))
            for y in range(self.y, self.bottom, height)
            for x in range(self.x, self.right, width)
        ]

    def halves(self, axis: int, *, multiple: int) -> list["Region"]:
        """Upper and lower half (0) or left and right one (1), cut at a multiple of a number if that cuts anything."""
        start, side = (self.y, self.height) if axis == 0 else (self.x, self.width)
        cut = (start + side // 2) // multiple * multiple - start
        cut = cut if cut > 0 else side // 2
        if axis == 0:
            return [replace(self, height=cut), replace(self, y=self.y + cut, height=side - cut)]
        return [replace(self, width=cut), replace(self, x=self.x + cut, width=side - cut)]

    def divided(self, factor: int) -> "Region":
        """The region of a picture `factor` times smaller; coordinates must be multiples of it."""
        return Region(self.x // factor, self.y // factor, self.width // factor, self.height // factor)

    def times(self, factor: int) -> "Region":
        """The region of a picture `factor` times larger."""
        return Region(self.x * factor, self.y * factor, self.width * factor, self.height * factor)

    def grown(self, margin: int, *, multiple: int = 1) -> "Region":
        """Larger by a margin on every side, then out to coordinates that are multiples of a number."""
        x, y = ((v - margin) // multiple * multiple for v in (self.x, self.y))
        right, bottom = (-(-(v + margin) // multiple) * multiple for v in (self.right, self.bottom))
        return Region(x, y, right - x, bottom - y)


@dataclass(frozen=True)
class Canvas:
    """Size and projection of a panorama.

    projection: name in PROJECTIONS
    scale:      canvas px per focal length (per radian straight ahead)
    origin:     plane coordinates, times scale, of the centre of pixel (0, 0)
    size:       (width, height) px
    wraps:      the right edge continues at the left edge: a closed full turn
    parameters: those of the projection; empty for its defaults
    reason:     why this projection, in words
    """

    projection: str
    scale: float
    origin: tuple[float, float]
    size: tuple[int, int]
    wraps: bool = False
    parameters: tuple[float, ...] = ()
    reason: str = field(default="", compare=False)

    @property
    def region(self) -> Region:
        """The whole canvas."""
        return Region(0, 0, *self.size)

    def rays(self, xy: Floats) -> Floats:
        """Canvas pixels (n, 2) to rays (n, 3); NaN where the projection shows nothing."""
        return PROJECTIONS[self.projection].inverse((xy + self.origin) / self.scale, *self.parameters)

    def pixels(self, rays: Floats) -> Floats:
        """Rays (n, 3) to canvas pixels (n, 2); NaN where the projection does not show them.

        Of the columns that a full turn apart show the same ray, the first one right of the left edge is meant.
        """
        projection = PROJECTIONS[self.projection]
        xy = projection.forward(rays, *self.parameters) * self.scale - self.origin
        if projection.period:
            xy[:, 0] = (xy[:, 0] + 0.5) % (projection.period * self.scale) - 0.5
        return xy

    def field(self, region: Region) -> tuple[float, float] | None:
        """Radians that a region shows along its middle row and its middle column; None where they end before it."""
        x, y = (region.x + region.right - 1) / 2, (region.y + region.bottom - 1) / 2
        ends = [(region.x - 0.5, y), (x, y), (region.right - 0.5, y), (x, region.y - 0.5), (x, region.bottom - 0.5)]
        rays = self.rays(np.array(ends))
        # a hair's breadth beyond the pole there is nothing
        if not np.isfinite(rays).all():
            return None
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        left, right, up, down = (float(np.arccos(np.clip(rays[1] @ rays[n], -1, 1))) for n in (0, 2, 3, 4))
        across = region.width / self.scale if PROJECTIONS[self.projection].period else left + right
        return across, up + down

    def reduced(self, factor: int) -> "Canvas":
        """The canvas at 1 / `factor` of its size, rounded up; each pixel covers `factor` x `factor` of this one.

        The left and top edges stay where they are; a closed turn must be wide a multiple of `factor`.
        """
        if factor == 1:
            return self
        width, height = (-(-n // factor) for n in self.size)
        # the centre of the reduced pixel (0, 0) lies at this pixel of the full canvas
        first = rescale(np.zeros(2), float(factor))
        x, y = (first + self.origin) / factor
        return replace(self, scale=self.scale / factor, origin=(float(x), float(y)), size=(width, height))


@dataclass(frozen=True)
class Layer:
    """Pixels with their place and their validity.

    pixels: (h, w, 3) float32 in 0..255, encoded as in the photo
    mask:   (h, w) bool, True where there is a picture
    """

    region: Region
    pixels: NDArray[np.float32]
    mask: NDArray[np.bool_]
