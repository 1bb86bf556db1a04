"""Features of photos of a flat scene, without pictures: planted points with planted descriptors."""

from dataclasses import dataclass

import numpy as np

from panostitch.model.features import Features
from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource

SIZE = (400, 300)
STEP = (240, 180)  # px from photo to photo: neighbours share 40 % of their width or height
DENSITY = 250  # points in a photo
NOISE = 0.06  # of each of the 64 entries of a descriptor of length 1: the ratio test leaves half of the true matches


@dataclass(frozen=True)
class Mosaic:
    """Photos in rows, their features, and the pairs of them that are next to each other in a row or a column."""

    photos: list[Photo]
    features: list[Features]
    neighbours: set[tuple[int, int]]

    def shuffled(self, order):
        """Photos and features in another order."""
        return [self.photos[n] for n in order], [self.features[n] for n in order]


def mosaic(columns, rows, *, seed=0, named_at_random=False):
    """A grid of photos, in the order of reading; names that are numbers at random say nothing of it."""
    rng = np.random.default_rng(seed)
    width, height = (columns - 1) * STEP[0] + SIZE[0], (rows - 1) * STEP[1] + SIZE[1]
    count = round(DENSITY * width * height / (SIZE[0] * SIZE[1]))
    points = rng.uniform((0, 0), (width, height), (count, 2))
    descriptors = rng.normal(size=(count, 64))
    descriptors /= np.linalg.norm(descriptors, axis=1, keepdims=True)
    scales = rng.gamma(2.0, 2.0, count).astype(np.float32) + 1
    names = rng.permutation(columns * rows) if named_at_random else np.arange(columns * rows)
    photos, features = [], []
    for n in range(columns * rows):
        corner = np.array([n % columns, n // columns]) * STEP
        seen = np.flatnonzero(((points >= corner) & (points < corner + SIZE)).all(1))
        photos.append(Photo(f"p{names[n]}.jpg", SIZE, ArraySource(np.zeros((1, 1, 3), np.uint8))))
        features.append(_seen(points[seen] - corner, scales[seen], descriptors[seen], rng))
    right = {(n, n + 1) for n in range(columns * rows) if (n + 1) % columns}
    below = {(n, n + columns) for n in range(columns * (rows - 1))}
    return Mosaic(photos, features, right | below)


def _seen(xy, scale, descriptors, rng):
    noisy = descriptors + rng.normal(scale=NOISE, size=descriptors.shape)
    noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
    xy = xy + rng.normal(scale=0.3, size=xy.shape)
    blank = np.zeros(len(xy), np.float32)
    return Features(xy.astype(np.float32), scale, blank, blank + 1, noisy.astype(np.float32), 1.0)
