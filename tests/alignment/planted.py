"""Links between photos whose cameras are known, made without any pixels."""

import numpy as np

from panostitch.geometry import homography
from panostitch.model.match import VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource

BLANK = ArraySource(np.zeros((1, 1, 3), np.uint8))


def blank_photos(cameras, **fields):
    """Photos without a picture, of the cameras' sizes."""
    return [Photo(f"p{n}", camera.size, BLANK, **fields) for n, camera in enumerate(cameras)]


def common_points(a, b, count, rng):
    """Points (count, 2) px of camera a that camera b sees too, and where; None where the two share too little."""
    xy = rng.uniform(0, a.size, (40 * count, 2))
    there = b.project(a.rays(xy))
    inside = ((there >= 0) & (there <= np.array(b.size) - 1)).all(1)
    return (xy[inside][:count], there[inside][:count]) if inside.sum() >= count else None


def link_of(i, j, xy_i, xy_j):
    found = homography.estimate(xy_i, xy_j, threshold=30.0, seed=0)
    return VerifiedMatch(i, j, xy_i, xy_j, found[0], len(xy_i), 0.4, 0.5, len(xy_i))


def planted_links(cameras, rng, *, count=100, noise=0.0, outliers=0.0, reach=25.0):
    """Links of all pairs that overlap; a share of outliers is up to `reach` px off."""
    links = []
    for i in range(len(cameras)):
        for j in range(i + 1, len(cameras)):
            points = common_points(cameras[i], cameras[j], count, rng)
            if points is None:
                continue
            xy_i, xy_j = (p + rng.normal(0, noise, p.shape) if noise else p for p in points)
            wrong = rng.random(count) < outliers
            xy_j = xy_j + wrong[:, None] * rng.uniform(-reach, reach, xy_j.shape)
            links.append(link_of(i, j, xy_i, xy_j))
    return links
