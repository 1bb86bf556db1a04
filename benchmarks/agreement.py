"""Do panostitch and cv2.Stitcher find the same panorama? Runs both on sets of photos and prints a Markdown table.

    python benchmarks/agreement.py FOLDER                 the sets of DEFAULT_SETS that are sub-folders of FOLDER
    python benchmarks/agreement.py FOLDER --sets a b c    these sub-folders
    python benchmarks/agreement.py FOLDER --all           every sub-folder that holds photos

Geometry: a grid of points of photo i goes to photo j by the cameras of either program; `difference` is the median
distance of where it arrives, in px of the full photo. Pictures: our panorama is rendered again as the rival's spherical
one, turned into its world and at its scale, and registered on it by SIFT matches and a similarity; `residual` is what
stays, px. `misfit`: how far each is from points that a third detector has matched (see `panostitch compare`), so that
one sees which of the two is off where they differ.

The exit code is 1 if, on a set where both succeed, the rival includes a photo that we leave out or the difference
exceeds TOLERANCE.
"""

import argparse
import sys
import tempfile
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch import pipeline
from panostitch.errors import PanostitchError
from panostitch.features import detect
from panostitch.geometry.rotation import nearest
from panostitch.io.readers import EXTENSIONS, open_photos
from panostitch.io.writers import assemble
from panostitch.jobs.compare import Comparison, compare
from panostitch.matching import match
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.features import Features
from panostitch.model.panorama import Panorama
from panostitch.model.photo import Photo, Pixels
from panostitch.options import FeatureOptions, LayoutOptions, MatchingOptions, Options
from panostitch.synthetic.score import pair_errors

Floats = NDArray[np.float64]

DEFAULT_SETS = (
    "uiuc_hill",
    "uiuc_pier",
    "kv_lunch",
    "mit_monu",
    "ebv_munich",
    "lpc_crossline",
    "park_trees",
    "op_flower",
    "ty_mountains",
)
TOLERANCE = 3.0  # px at the rival's working size: three times the noise of its corners
RIVAL_MEGAPIXELS = 0.6  # cv2.Stitcher's default registration resolution
SAME_PLACE = 0.01  # of the panorama's longer side: matches further off the similarity are wrong, not inexact
FEWEST_MATCHES = 20
HEAD = (
    "set",
    "photos, rival",
    "photos, ours",
    "difference px",
    "tolerance px",
    "residual px",
    "misfit px, rival",
    "misfit px, ours",
    "seconds, ours/rival",
    "memory, ours/rival",
    "verdict",
)


@dataclass(frozen=True)
class Masked:
    """A picture (h, w, 3) in memory and where it shows anything (h, w)."""

    pixels: Pixels
    mask: Pixels

    def read(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """Both at `scale` <= 1."""
        if scale == 1.0:
            return self.pixels, self.mask
        size = tuple(max(1, round(n * scale)) for n in self.mask.shape[::-1])
        pixels, mask = (cv2.resize(a, size, interpolation=cv2.INTER_AREA) for a in (self.pixels, self.mask))
        return np.asarray(pixels, np.uint8), np.asarray((mask == 255) * 255, np.uint8)


def main() -> int:
    """Run the sets that the command line names; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="its sub-folders are the sets")
    parser.add_argument("--sets", nargs="+", help="names of sub-folders")
    parser.add_argument("--all", action="store_true", help="every sub-folder")
    given = parser.parse_args()
    everything = sorted(path.name for path in given.folder.iterdir() if path.is_dir())
    names = given.sets or (everything if given.all else [name for name in DEFAULT_SETS if name in everything])
    if not names:
        parser.error(f"{given.folder} holds none of {', '.join(DEFAULT_SETS)}; see --sets and --all")
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}", flush=True)
    disagreements = 0
    for name in names:
        row, agree = run_set(given.folder / name)
        disagreements += not agree
        print(f"| {' | '.join(row)} |", flush=True)
    return 1 if disagreements else 0


def run_set(folder: Path) -> tuple[list[str], bool]:
    """One row of the table, and whether the programs agree."""
    paths = [path for path in folder.iterdir() if path.suffix.lower() in EXTENSIONS]
    photos, _ = open_photos(sorted(paths))
    if len(photos) < 2:
        return [folder.name, *["-"] * (len(HEAD) - 2), "fewer than two photos"], True
    with tempfile.TemporaryDirectory(prefix="panostitch-agreement-") as home:
        comparison = compare(photos, Options(), home)
        rival, ours = comparison.rival, comparison.ours
        tolerance = TOLERANCE * max(1.0, np.sqrt(np.median([p.megapixels for p in photos]) / RIVAL_MEGAPIXELS))
        difference = geometric_difference(rival.cameras, ours.cameras)
        residual = picture_residual(comparison)
    verdict, agree = judge(comparison, difference, tolerance)
    row = [
        folder.name,
        *(f"{len(comparison.included(o))} of {len(photos)}" for o in comparison.outcomes),
        number(difference),
        number(tolerance),
        number(residual),
        *(number(misfit.median if misfit else None) for misfit in comparison.misfits),
        number(ratio(ours.seconds, rival.seconds)),
        number(ratio(ours.peak_megabytes, rival.peak_megabytes)),
        verdict,
    ]
    return row, agree


def judge(comparison: Comparison, difference: float | None, tolerance: float) -> tuple[str, bool]:
    """The verdict in words, and whether the programs agree; where one fails there is nothing to agree on."""
    failed = [f"{o.program}: {o.status}" for o in comparison.outcomes if not o.size]
    if failed:
        return "; ".join(failed), True
    missing = set(comparison.included(comparison.rival)) - set(comparison.included(comparison.ours))
    if missing:
        return f"only the rival includes {', '.join(sorted(missing))}", False
    if difference is None:
        return "no overlap in common", False
    return ("agree", True) if difference <= tolerance else ("differ", False)


def geometric_difference(rival: tuple[Camera | None, ...], ours: tuple[Camera | None, ...]) -> float | None:
    """Median distance px, over all overlaps, of where the two programs send points of one photo in another."""
    distances = []
    for (rival_i, ours_i), (rival_j, ours_j) in permutations(zip(rival, ours, strict=False), 2):
        if rival_i and rival_j and ours_i and ours_j:
            distances.append(pair_errors((rival_i, rival_j), (ours_i, ours_j)))
    return float(np.median(np.concatenate(distances))) if sum(map(len, distances)) else None


def picture_residual(comparison: Comparison) -> float | None:
    """Median distance px of matched points of both panoramas after a similarity; None if they cannot be registered."""
    rival, alignment = comparison.rival, comparison.ours.alignment
    if not rival.picture or not alignment:
        return None
    theirs = np.asarray(np.load(rival.picture))
    try:
        pixels, mask = assemble(as_the_rival(alignment, comparison))
    except PanostitchError:
        return None
    shown = np.asarray(theirs.any(axis=2) * 255, np.uint8)
    return registration_residual(Masked(theirs, shown), Masked(pixels, mask))


def as_the_rival(alignment: Alignment, comparison: Comparison) -> Panorama:
    """Our panorama, spherical, in the world and at the scale of the rival's."""
    if alignment.model != "rotation":
        alignment = pipeline.align(alignment.photos, Options.of(model="rotation", straighten="none"))
    rival = {p.name: c for p, c in zip(comparison.photos, comparison.rival.cameras, strict=True) if c}
    both = [(c, rival[p.name]) for p, c in zip(alignment.photos, alignment.cameras, strict=True) if p.name in rival]
    ours_from_rival = nearest(np.sum([c.cam_from_world.T @ r.cam_from_world for c, r in both], axis=0))
    turned = replace(alignment, cameras=tuple(c.turned(ours_from_rival) for c in alignment.cameras))
    # OpenCV's spherical warper has the median focal length for its radius
    radius = np.median([camera.focal for camera in rival.values()])
    scale = float(radius / np.median([camera.focal for camera in alignment.cameras]))
    layout = LayoutOptions(projection="equirectangular", scale=scale, crop="none")
    return pipeline.render(turned, Options(layout=layout))


def registration_residual(a: Masked, b: Masked) -> float | None:
    """Median distance px of SIFT matches of two pictures after the similarity that fits them best."""
    pictures = [Photo(name, source.mask.shape[::-1], source) for name, source in (("a", a), ("b", b))]
    options = FeatureOptions(work_megapixels=4.0, max_features=2000)
    found = [f for f in detect(pictures, options) if isinstance(f, Features)]
    (putative,) = match(found, [(0, 1)], MatchingOptions(ratio=0.7))
    if len(putative.pairs) < FEWEST_MATCHES:
        return None
    xy_a, xy_b = (f.xy[putative.pairs[:, n]].astype(np.float64) for n, f in enumerate(found))
    threshold = SAME_PLACE * max(a.mask.shape)
    similarity, inliers = cv2.estimateAffinePartial2D(xy_a, xy_b, ransacReprojThreshold=threshold)
    if similarity is None or inliers.sum() < FEWEST_MATCHES:
        return None
    distances = np.linalg.norm(xy_a @ similarity[:, :2].T + similarity[:, 2] - xy_b, axis=1)
    return float(np.median(distances[inliers.ravel() > 0]))


def ratio(ours: float | None, rival: float | None) -> float | None:
    """How many times the rival's."""
    return ours / rival if ours and rival else None


def number(value: float | None) -> str:
    """With two decimals; a dash for nothing."""
    return "-" if value is None else f"{value:.2f}"


if __name__ == "__main__":
    sys.exit(main())
