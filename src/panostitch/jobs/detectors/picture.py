"""A picture of all detectors: a row for each, with its key points and its matches on the pair that is linked best."""

import numpy as np
from numpy.typing import NDArray

from panostitch.debug import draw, ink
from panostitch.geometry.sampling import rescale
from panostitch.jobs.detectors.trials import Contest, Trial
from panostitch.matching import MATCHERS
from panostitch.model.features import Features
from panostitch.model.photo import Photo

PANEL = 520  # px, longest side of a photo
GAP = 8  # px
LABEL = 34  # px


def picture(contest: Contest) -> ink.Picture:
    """RGB (h, w, 3). Green: right matches; red: wrong ones; where there is no reference the colour tells the place."""
    number = contest.best_pair
    first, second = (contest.photos[n] for n in contest.pairs[number])
    panels = _panel(first), _panel(second)
    shown = next(iter(MATCHERS))
    rows = [_row(trial, number, (first, second), panels) for trial in contest.trials if trial.matcher == shown]
    return np.asarray(np.vstack(rows), np.uint8)


def _panel(photo: Photo) -> ink.Picture:
    pixels, _ = photo.source.read(min(1.0, PANEL / max(photo.size)))
    return ink.to_bytes(ink.fit(pixels, PANEL))


def _row(
    trial: Trial, number: int, photos: tuple[Photo, Photo], panels: tuple[ink.Picture, ink.Picture]
) -> ink.Picture:
    matches = trial.matches[number]
    here, there = (
        _placed(trial.features[n].xy[matches.pairs[:, side]], photos[side], panels[side])
        for side, n in enumerate((matches.i, matches.j))
    )
    if trial.right:
        right = trial.right[number]
        groups = [
            draw.Lines(here[~right], there[~right], ink.VERMILLION),
            draw.Lines(here[right], there[right], ink.GREEN),
        ]
    else:
        groups = [draw.Lines(here, there)]
    points, lines = _key_points(trial.features[matches.i], photos[0], panels[0]), draw.matches(*panels, groups)
    sheet = ink.blank(LABEL + lines.shape[0] + GAP, points.shape[1] + GAP + lines.shape[1])
    ink.write(sheet, ink.shorten(_words(trial, number, photos), sheet.shape[1] - 2 * GAP), (GAP, LABEL / 2))
    sheet[LABEL : LABEL + points.shape[0], : points.shape[1]] = points
    sheet[LABEL : LABEL + lines.shape[0], points.shape[1] + GAP :] = lines
    return sheet


def _key_points(features: Features, photo: Photo, panel: ink.Picture) -> ink.Picture:
    size = panel.shape[1] / photo.size[0]
    angle, response = features.angle.astype(np.float64), features.response.astype(np.float64)
    return draw.features(panel, _placed(features.xy, photo, panel), features.scale * size, angle, response)


def _placed(xy: NDArray[np.float32], photo: Photo, panel: ink.Picture) -> NDArray[np.float64]:
    """Px (n, 2) of a photo in px of its panel."""
    return rescale(xy.astype(np.float64), np.array(panel.shape[1::-1]) / photo.size)


def _words(trial: Trial, number: int, photos: tuple[Photo, Photo]) -> str:
    matches, link = trial.matches[number], trial.links[number]
    judged = f", {trial.right[number].mean():.0%} right" if trial.right and len(matches.pairs) else ""
    verdict = f"{link.inliers} verified" if link else "not linked"
    return (
        f"{trial.detector}: {len(trial.features[matches.i])} key points; {photos[0].name} - {photos[1].name}: "
        f"{len(matches.pairs)} of {len(matches.raw)} matches kept{judged}, {verdict}"
    )
