"""How many samples RANSAC needs for a homography: theory, plain RANSAC, and the program's MAGSAC++."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.geometry import homography
from report import Claim, Finding, Plot, Report, Series, Table, cells

TITLE = "Samples that RANSAC needs"
CLAIM = Claim(
    "With a share w of inliers, log(1 - p) / log(1 - w^4) samples of four matches find the homography with probability "
    "p.",
    "Fischler & Bolles 1981; Hartley & Zisserman 2004, section 4.7",
)
P = 0.99
NOISE = 1.0  # px, standard deviation of each coordinate
THRESHOLD = 3.0  # px
FOUND = 0.9  # of the true inliers that a model must explain for it to be called found
HALF = 0.5  # a start from which least squares may get there
SIZE = np.array([1000.0, 750.0])  # px
SAMPLE = 4
AS_TOLD = 1.25  # times the theory: more is not what was promised,
STEP = 2.0  # where it is known to a power of two only
METHOD = (
    f"200 matches of a known homography between photos of {SIZE[0]:.0f} x {SIZE[1]:.0f} px with noise of {NOISE:g} "
    f"px, of which a share is replaced by random ones; threshold {THRESHOLD:g} px. A sample has found the homography "
    f"if the model through its four matches explains {FOUND:.0%} of the true inliers. From the share q of samples "
    f"that do, drawn many thousand times, come the samples after which one has done so with p = {P:g}: log(1 - p) / "
    "log(1 - q). The same without noise, and for models that explain half of the inliers. MAGSAC++ is OpenCV's, with "
    "local optimisation, as the program calls it but with a bound on the iterations: the least power of two with "
    f"which {P:.0%} of the trials find the homography."
)


@dataclass(frozen=True)
class Settings:
    """Shares of outliers; samples drawn for each; trials of MAGSAC++ for each bound, and the largest bound."""

    outliers: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
    samples: int = 100_000
    trials: int = 200
    most: int = 8192


FULL, TINY = Settings(), Settings((0.2, 0.6), 3000, 5, 64)
MATCHES = 200
CHUNK = 2000  # samples at once


@dataclass(frozen=True)
class Problem:
    """Matches (n, 2) px, and which are true."""

    src: NDArray[np.float64]
    dst: NDArray[np.float64]
    true: NDArray[np.bool_]


@dataclass(frozen=True)
class Way:
    """How plain RANSAC is tried: noise of the matches, px, and the share of the inliers that a model must explain."""

    noise: float
    found: float


WAYS = {
    "plain, no noise": Way(0.0, FOUND),
    f"plain, {NOISE:g} px": Way(NOISE, FOUND),
    f"plain, {NOISE:g} px, half is enough": Way(NOISE, HALF),
}


def experiment(settings: Settings = FULL) -> Report:
    """Theory and measurement for all shares of outliers."""
    theory = [promised(1 - share) for share in settings.outliers]
    plain = {name: [needed(share, way, settings) for share in settings.outliers] for name, way in WAYS.items()}
    magsac = [bound(share, settings) for share in settings.outliers]
    percents = [100 * share for share in settings.outliers]
    plot = Plot(
        "ransac-samples",
        f"Samples until the homography is found with p = {P:g}",
        "share of outliers, %",
        "samples",
        (
            Series("theory", percents, theory, theory=True),
            *(Series(name, percents, samples) for name, samples in plain.items()),
            Series(f"MAGSAC++, {NOISE:g} px", percents, magsac),
        ),
        log_y=True,
    )
    rows = [
        cells(f"{share:.0%}", *(rounded(value) for value in values))
        for share, *values in zip(settings.outliers, theory, *plain.values(), magsac, strict=True)
    ]
    table = Table("Samples", ("outliers", "theory", *WAYS, f"MAGSAC++, {NOISE:g} px"), tuple(rows))
    return Report(TITLE, CLAIM, METHOD, findings(theory, list(plain.values()), magsac), (table,), (plot,))


def promised(inliers: float, chance: float = P) -> float:
    """The formula of the textbook."""
    return float(np.log(1 - chance) / np.log(1 - inliers**SAMPLE))


def problem(outliers: float, noise: float, seed: int) -> Problem:
    """Matches of a homography as two photos of a turning camera have it."""
    dice = np.random.default_rng(seed)
    turn, focal = np.deg2rad(20), 900.0
    inner = np.array([[focal, 0, SIZE[0] / 2], [0, focal, SIZE[1] / 2], [0, 0, 1]])
    rotation = np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
    src = dice.uniform((SIZE[0] * 0.4, 0), SIZE, (MATCHES, 2))
    dst = homography.apply(inner @ rotation @ np.linalg.inv(inner), src)
    dst = dst + dice.normal(0, noise, dst.shape) if noise else dst
    true = np.arange(MATCHES) >= round(outliers * MATCHES)
    dst[~true] = dice.uniform(0, SIZE, ((~true).sum(), 2))
    return Problem(src, dst, true)


def needed(outliers: float, way: "Way", settings: Settings) -> float:
    """Samples that plain RANSAC needs; infinite where none of those drawn was good."""
    dice = np.random.default_rng(1)
    good = 0
    for chunk in range(0, settings.samples, CHUNK):
        given = problem(outliers, way.noise, seed=chunk)  # other matches each time, so that no layout decides
        count = min(CHUNK, settings.samples - chunk)
        chosen = dice.random((count, MATCHES)).argpartition(SAMPLE, axis=1)[:, :SAMPLE]
        good += int(is_found(models(given.src[chosen], given.dst[chosen]), given, way.found).sum())
    share = good / settings.samples
    if share in (0, 1):
        return 1.0 if share else np.inf
    return float(np.log(1 - P) / np.log(1 - share))


def models(src: NDArray[np.float64], dst: NDArray[np.float64]) -> NDArray[np.float64]:
    """Homographies (n, 3, 3) through four matches (n, 4, 2) each; NaN where there is none."""
    x, y = np.moveaxis(src, -1, 0)
    one, nil = np.ones_like(x), np.zeros_like(x)
    rows = []
    for along, place in ((0, dst[..., 0]), (1, dst[..., 1])):
        left, right = ([x, y, one], [nil] * 3) if along == 0 else ([nil] * 3, [x, y, one])
        rows.append(np.stack([*left, *right, -place * x, -place * y], axis=-1))
    system = np.concatenate(rows, axis=1)
    sound = np.abs(np.linalg.det(system)) > 0
    entries = np.full((len(src), 8), np.nan)
    entries[sound] = np.linalg.solve(system[sound], np.concatenate([dst[..., 0], dst[..., 1]], axis=1)[sound, :, None])[
        ..., 0
    ]
    return np.concatenate([entries, np.ones((len(src), 1))], axis=1).reshape(-1, 3, 3)


def is_found(found: NDArray[np.float64], given: Problem, enough: float = FOUND) -> NDArray[np.bool_]:
    """Which of the models (n, 3, 3) explain enough of the true inliers, a share."""
    points = np.column_stack([given.src, np.ones(len(given.src))])[given.true]
    sent = np.einsum("nij,kj->nki", found, points)
    with np.errstate(all="ignore"):
        off = np.linalg.norm(sent[..., :2] / sent[..., 2:] - given.dst[given.true], axis=2)
    return np.asarray((off <= THRESHOLD).mean(1) >= enough)


def bound(outliers: float, settings: Settings) -> float:
    """The least bound on its iterations with which MAGSAC++ finds the homography; infinite where none suffices."""
    most = 1
    while most <= settings.most:
        if np.mean([magsac_finds(problem(outliers, NOISE, seed), most, seed) for seed in range(settings.trials)]) >= P:
            return float(most)
        most *= round(STEP)
    return float("inf")


def magsac_finds(given: Problem, most: int, seed: int) -> bool:
    """Whether MAGSAC++ finds the homography in so many iterations."""
    params = homography.usac(THRESHOLD, seed)
    params.maxIterations = most
    found, _ = cv2.findHomography(given.src, given.dst, params)
    return found is not None and bool(is_found(np.asarray(found)[None], given)[0])


def rounded(samples: float) -> str:
    """Samples as a cell."""
    return "more" if np.isinf(samples) else f"{samples:.0f}" if samples >= 10 else f"{samples:.1f}"


def findings(theory: list[float], plain: list[list[float]], magsac: list[float]) -> tuple[Finding, ...]:
    """Whether the formula says what is needed."""
    clean, noisy, half = (np.array(samples) / theory for samples in plain)
    saved = np.array(magsac) / theory
    return (
        Finding(
            "holds" if clean.max() < AS_TOLD else "does not hold",
            f"without noise plain RANSAC needs {clean.min():.2f} to {clean.max():.2f} times what the formula says.",
        ),
        Finding(
            "holds" if noisy.max() < AS_TOLD else "does not hold",
            f"with noise of {NOISE:g} px it needs {noisy.min():.1f} to {noisy.max():.1f} times as many samples, and "
            f"{half.min():.1f} to {half.max():.1f} times where a model that explains half of the inliers is enough: "
            "four noisy matches that lie close together give a model that is right there and wrong elsewhere, so "
            "that not every sample of inliers is a good one.",
        ),
        Finding(
            "holds" if saved.max() < STEP else "holds in part" if saved.min() < STEP else "does not hold",
            f"with the same noise MAGSAC++ needs {saved.min():.2g} to {saved.max():.2g} times as "
            "many as the formula says, to a power of two: it improves what it finds on all that agrees (local "
            "optimisation), so that a sample of inliers is good again.",
        ),
    )
