"""Pictures of pairs of photos. There are as many pairs as photos squared, so the telling ones are chosen."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from panostitch.debug import draw
from panostitch.debug.filenames import FileNames
from panostitch.debug.folder import MATCHES
from panostitch.debug.ink import GREEN, VERMILLION, Picture, captioned
from panostitch.geometry.sampling import rescale
from panostitch.model.features import Features
from panostitch.model.match import Link, PutativeMatch, VerifiedMatch
from panostitch.model.photo import Photo

Floats = NDArray[np.float64]
Pair = tuple[int, int]

ALL_PAIRS = 30  # up to here every pair is drawn
MOST_PAIRS = 60  # drawn if there are more: all links first, then refused pairs with many inliers
_MOST_HELD = 4 * MOST_PAIRS


@dataclass(frozen=True)
class _Held:
    """A pair that waits to be drawn."""

    photos: tuple[Photo, Photo]
    features: tuple[Features, Features]
    match: PutativeMatch


class PairPictures:
    """Holds pairs back until all are known, then draws the telling ones."""

    def __init__(
        self,
        save: Callable[[str, Callable[[], Picture]], None],
        remove: Callable[[str], None],
        names: FileNames,
        pixels: Callable[[Photo], Picture],
    ) -> None:
        self._save, self._remove, self._names, self._pixels = save, remove, names, pixels
        self._held: dict[Pair, _Held] = {}
        self._photos: dict[Pair, tuple[str, str]] = {}
        self._drawn: set[Pair] = set()
        self.links: dict[Pair, Link] = {}

    @property
    def not_drawn(self) -> list[tuple[str, str]]:
        """Names of the pairs that have no pictures."""
        return [names for pair, names in self._photos.items() if pair not in self._drawn]

    def hold(self, photos: Sequence[Photo], features: Sequence[Features], match: PutativeMatch, link: Link) -> None:
        """Keep a pair until `draw`."""
        i, j = match.i, match.j
        self.links[i, j] = link
        self._photos[i, j] = (photos[i].name, photos[j].name)
        self._held[i, j] = _Held((photos[i], photos[j]), (features[i], features[j]), match)
        if len(self._held) > _MOST_HELD:
            self._held = {pair: self._held[pair] for pair in self._telling(MOST_PAIRS)}

    def decide(self, link: Link) -> None:
        """What finally became of a pair."""
        self.links[link.i, link.j] = link

    def draw(self) -> None:
        """Draw the pairs that are held and let go of them."""
        room = len(self._photos) if len(self._photos) <= ALL_PAIRS else MOST_PAIRS
        room -= len(self._drawn - self._held.keys())
        for pair in sorted(self._telling(max(0, room))):
            self._draw(self._held[pair], self.links[pair])
            self._drawn.add(pair)
        self._held.clear()

    def _telling(self, most: int) -> list[Pair]:
        """Pairs that are held: links first, then by inliers."""

        def rank(pair: Pair) -> tuple[bool, int, Pair]:
            return not self.links[pair], -self.links[pair].inliers, pair

        return sorted(self._held, key=rank)[:most]

    def _draw(self, held: _Held, link: Link) -> None:
        stem = f"{MATCHES}/" + "--".join(self._names.of(photo.name) for photo in held.photos)
        steps = (
            ("1_raw", held.match.raw, "nearest neighbours"),
            ("2_ratio", held.match.pairs, "matches after the ratio test"),
        )
        for suffix, chosen, what in steps:
            self._save(f"{stem}_{suffix}.jpg", partial(self._by_descriptors, held, chosen, what))
        # a pair may be tried again with another outcome
        outcome, other = ("3_verified", "3_refused") if link else ("3_refused", "3_verified")
        self._remove(f"{stem}_{other}.jpg")
        self._save(f"{stem}_{outcome}.jpg", lambda: self._outcome(held, link))

    def _by_descriptors(self, held: _Held, chosen: NDArray[np.int32], what: str) -> Picture:
        left, right = (self._pixels(photo) for photo in held.photos)
        drawn = draw.matches(left, right, [_lines(held, chosen, left, right)])
        return captioned(drawn, f"{_title(held)}   {len(chosen)} {what}{_share(len(chosen))}")

    def _outcome(self, held: _Held, link: Link) -> Picture:
        left, right = (self._pixels(photo) for photo in held.photos)
        title = _title(held)
        if not isinstance(link, VerifiedMatch):
            drawn = draw.matches(left, right, [_lines(held, held.match.pairs, left, right, VERMILLION)])
            needed = f" ({link.needed} needed)" if link.needed else ""
            return captioned(
                drawn, f"{title}   refused: {link.reason}", f"{link.putative} matches, {link.inliers} inliers{needed}"
            )
        outliers = held.match.pairs[~agreeing(held.features, held.match.pairs, link)]
        good = draw.Lines(
            _drawn_at(link.xy_i, held.photos[0], left), _drawn_at(link.xy_j, held.photos[1], right), GREEN
        )
        bad = _lines(held, outliers, left, right, VERMILLION)
        drawn = draw.matches(left, right, [bad, good], overlap=_overlap(held, link, right))
        numbers = f"{link.inliers} inliers (green{_share(link.inliers)}), {len(outliers)} outliers (red)"
        return captioned(
            drawn,
            f"{title}   {numbers}",
            f"overlap {link.overlap:.0%}, error {link.error:.2f} px; white: where the left photo lies in the right one",
        )


def _title(held: _Held) -> str:
    return " -- ".join(photo.name for photo in held.photos)


def _share(number: int) -> str:
    return f", {draw.MOST_LINES} drawn" if number > draw.MOST_LINES else ""


def _drawn_at(xy: NDArray[np.floating], photo: Photo, picture: Picture) -> Floats:
    """Coordinates (n, 2) px of a photo in its picture."""
    return rescale(xy, np.array(picture.shape[1::-1]) / photo.size)


def _lines(
    held: _Held, chosen: NDArray[np.int32], left: Picture, right: Picture, ink: tuple[int, int, int] | None = None
) -> draw.Lines:
    """Lines of the matches (n, 2) with these indices of features."""
    xy_i, xy_j = (features.xy[chosen[:, side]] for side, features in enumerate(held.features))
    return draw.Lines(_drawn_at(xy_i, held.photos[0], left), _drawn_at(xy_j, held.photos[1], right), ink)


def agreeing(features: tuple[Features, Features], pairs: NDArray[np.int32], link: VerifiedMatch) -> NDArray[np.bool_]:
    """Which (n,) of the matches (n, 2) after the ratio test the homography explains."""
    inliers = {tuple(row) for row in np.hstack([link.xy_i, link.xy_j]).astype(np.float32).tolist()}
    ends = np.hstack([features[0].xy[pairs[:, 0]], features[1].xy[pairs[:, 1]]]).astype(np.float32)
    return np.array([tuple(row) in inliers for row in ends.tolist()], np.bool_)


def _overlap(held: _Held, link: VerifiedMatch, right: Picture) -> Floats | None:
    """Outline (4, 2) of the left photo in the picture of the right one; None where the homography folds it over."""
    width, height = held.photos[0].size
    corners = np.array([(0, 0, 1), (width - 1, 0, 1), (width - 1, height - 1, 1), (0, height - 1, 1)], np.float64)
    sent = corners @ link.j_from_i.T
    # the sign of a homography is free, but it has to be the same everywhere in the photo
    if not (np.abs(sent[:, 2]) > 1e-9).all() or np.ptp(np.sign(sent[:, 2])) > 0:
        return None
    return _drawn_at(sent[:, :2] / sent[:, 2:], held.photos[1], right)
