"""What the overlaps of photos say of their light: ratios of means over small cells of the reduced canvas."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.model.canvas import Layer, Region

Floats = NDArray[np.float64]
Pieces = Sequence[tuple[int, Layer]]
# From a photo and a region of the reduced canvas to the squares (h, w) of the radii at which the photo sees it
Squares = Callable[[int, Region], Floats]

DARK, BRIGHT = 8.0, 247.0  # grey levels outside of which a channel says nothing of the light
WHITE = 255.0
# Grey levels from black and from white from which on ratios are trusted in full: nearer to them they are bent by stray
# light, black levels and the ends of tone curves
TRUSTED = 64.0
MIN_SAMPLES = 30  # px of the reduced canvas
MIN_CELLS = 8
COVERED = 0.5  # share of a cell that both photos must show
MOST_CELLS = 60_000  # of all pairs together
CELLS_OF_A_PAIR = 150, 1500  # at most, where there are many pairs and where there are few


@dataclass(frozen=True)
class Overlaps:
    """Cells that two photos i and j both see, of all pairs one after the other.

    pair:     (m,) number of the pair
    i, j:     (m,) photos
    logs:     (m, 3) log of the ratio i / j of the encoded pixels, for each channel
    square_i, square_j: (m,) squares of the radii in either photo
    share:    (m,) the overlap's share of the smaller photo, divided among the pair's cells
    fold:     (m,) bool; halves of each overlap: opposite quarters of it are together
    """

    pair: NDArray[np.intp]
    i: NDArray[np.intp]
    j: NDArray[np.intp]
    logs: Floats
    square_i: Floats
    square_j: Floats
    share: Floats
    fold: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.pair)

    @property
    def starts(self) -> NDArray[np.intp]:
        """The first cell of each pair."""
        return np.flatnonzero(np.diff(self.pair, prepend=-1))

    @property
    def pairs(self) -> list[slice]:
        """The cells of each pair."""
        starts = self.starts
        return [slice(start, end) for start, end in zip(starts, [*starts[1:], len(self)], strict=True)]

    def where(self, chosen: NDArray[np.bool_]) -> "Overlaps":
        """Some of the cells."""
        return Overlaps(**{name: array[chosen] for name, array in vars(self).items()})


def find_overlaps(pieces: Pieces, squares: Squares) -> Overlaps:
    """The cells of all pairs of photos; a photo may come in two pieces."""
    pairs = [(a, b) for a, b in that_touch([layer.region for _, layer in pieces]) if pieces[a][0] != pieces[b][0]]
    # whichever comes first, a pair is looked at from its lower number: the order of pieces does not matter
    pairs = [(a, b) if pieces[a][0] < pieces[b][0] else (b, a) for a, b in pairs]
    most = int(np.clip(MOST_CELLS / max(1, len(pairs)), *CELLS_OF_A_PAIR))
    found = [cells for a, b in pairs if (cells := _cells(pieces[a], pieces[b], squares, most))]
    columns = [np.concatenate(column) for column in zip(*found, strict=True)] if found else _NOTHING
    numbers = np.repeat(np.arange(len(found)), [len(cells[0]) for cells in found])
    return Overlaps(numbers, *columns)


def that_touch(regions: Sequence[Region]) -> Iterator[tuple[int, int]]:
    """Pairs a < b of regions that have pixels in common."""
    sides = np.array([(r.x, r.y, r.right, r.bottom) for r in regions]).reshape(-1, 4)
    for a, (x, y, right, bottom) in enumerate(sides):
        left, top, behind, below = sides[a + 1 :].T
        for b in np.flatnonzero((left < right) & (x < behind) & (top < bottom) & (y < below)).tolist():
            yield a, a + 1 + b


_NOTHING = [
    *(np.zeros(0, np.intp),) * 2, np.zeros((0, 3)), *(np.zeros(0),) * 3, np.zeros(0, bool)
]  # fmt: skip


def _cells(
    one: tuple[int, Layer], other: tuple[int, Layer], squares: Squares, most: int
) -> tuple[NDArray[np.generic], ...] | None:
    """i, j, logs, squares of radii, share, fold of the cells of a pair; None where there are too few."""
    (i, first), (j, second) = one, other
    common = first.region & second.region
    a, b = (layer.pixels[common.within(layer.region)] for layer in (first, second))
    both = first.mask[common.within(first.region)] & second.mask[common.within(second.region)]
    both &= all_channels((np.minimum(a, b) > DARK) & (np.maximum(a, b) < BRIGHT))
    samples = int(both.sum())
    if samples < MIN_SAMPLES:
        return None
    side = int(np.ceil(np.sqrt(samples / most)))
    covered = _means(both.astype(np.float32), side)
    used = covered >= COVERED
    count = int(used.sum())
    if count < MIN_CELLS:
        return None
    means_a, means_b = (_means(np.asarray(cv2.copyTo(x, both.view(np.uint8))), side)[used] for x in (a, b))
    radii = [_means(np.asarray(squares(n, common), np.float32), side)[used] for n in (i, j)]
    trust = _trust(*(means / covered[used][:, None] for means in (means_a, means_b)))
    share = samples / min(int(first.mask.sum()), int(second.mask.sum())) * trust / trust.sum()
    rows, columns = np.nonzero(used)
    fold = (rows > np.median(rows)) ^ (columns > np.median(columns))
    numbers = (np.full(count, n) for n in (i, j))
    return *numbers, np.log(means_a / means_b), *radii, share, fold


def _trust(one: Floats, other: Floats) -> Floats:
    """How far (m,) to trust ratios of means (m, 3): less where they are dark or bright (Debevec & Malik 1997)."""
    dark, bright = np.minimum(one, other).min(1), np.maximum(one, other).max(1)
    return np.asarray(np.minimum(np.minimum(dark, WHITE - bright) / TRUSTED, 1))


def all_channels(which: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where (h, w) something is so in all three channels (h, w, 3); NumPy is slow along so short an axis."""
    return np.asarray(cv2.inRange(which.view(np.uint8), (1, 1, 1), (1, 1, 1)) > 0)


def _means(array: NDArray[np.float32], side: int) -> Floats:
    """Means over squares of `side` px of an array (h, w) or (h, w, 3); what is left over at the end is left out."""
    height, width = (n // side * side for n in array.shape[:2])
    if not height or not width:
        return np.zeros((0, 0, *array.shape[2:]))
    cut = np.ascontiguousarray(array[:height, :width], np.float32)
    size = (width // side, height // side)
    return np.asarray(cv2.resize(cut, size, interpolation=cv2.INTER_AREA), np.float64)
