"""Make docs/images from the samples: the panoramas, and scaled-down pictures of their debug folders (`make docs`)."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from panostitch.cli.main import run
from panostitch.debug import ink
from panostitch.errors import EXIT_OK
from panostitch.io.readers import open_photos
from panostitch.io.writers import write_picture
from panostitch.jobs import detectors
from panostitch.options import Options

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "images"
SAMPLES = ("hall", "poster")
QUALITY = 80
GAP = 6  # px


@dataclass(frozen=True)
class Picture:
    """What a picture is made of.

    width: px
    parts: files of the debug folders, one below the other
    box:   left, top, right, bottom of what is shown of them, as shares
    """

    width: int
    parts: tuple[str, ...]
    box: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)


PAIR = "hall/02_matches/hall_2--hall_3"
PICTURES = {
    "hall": Picture(1400, ("hall/10_panorama/panorama.jpg",)),
    "poster": Picture(900, ("poster/10_panorama/panorama.jpg",)),
    "hall-key-points": Picture(700, ("hall/01_features/hall_3.jpg",)),
    "hall-descriptors": Picture(700, ("hall/01_features/hall_3.jpg",), (0.36, 0.3, 0.62, 0.57)),
    "hall-raw": Picture(1000, (f"{PAIR}_1_raw.jpg",)),
    "hall-ratio": Picture(1000, (f"{PAIR}_2_ratio.jpg",)),
    "hall-matches": Picture(1000, (f"{PAIR}_3_verified.jpg",)),
    "hall-cameras": Picture(1000, ("hall/04_alignment/layout.png",)),
    "hall-warped": Picture(1000, tuple(f"hall/05_warped/hall_{n}.jpg" for n in (2, 3))),
    "hall-exposure": Picture(1000, ("hall/06_exposure/before.jpg", "hall/06_exposure/after.jpg")),
    "hall-seams": Picture(1200, ("hall/07_seams/seams.jpg",)),
    "hall-bands": Picture(900, ("hall/08_blend/band_0.jpg", "hall/08_blend/band_2.jpg", "hall/08_blend/lowpass.jpg")),
    "hall-crop": Picture(1000, ("hall/09_crop/crop.jpg",)),
}
DETECTORS = "hall-detectors"  # made by the command of that name


def main() -> None:
    """Stitch the samples and write every picture."""
    with tempfile.TemporaryDirectory(prefix="panostitch-docs-") as home:
        for sample in SAMPLES:
            photos, panorama = str(ROOT / "samples" / sample), str(Path(home) / f"{sample}.jpg")
            if run([photos, "-o", panorama, "--debug-dir", str(Path(home) / sample), "--quiet"]) != EXIT_OK:
                raise SystemExit(f"{sample} cannot be stitched")
        for name, picture in PICTURES.items():
            save(name, composed(picture, Path(home)))
    photos, _ = open_photos(sorted((ROOT / "samples" / "hall").iterdir()))
    save(DETECTORS, ink.to_bytes(ink.fit(detectors.picture(detectors.hold(photos, Options())), 1000)))


def composed(picture: Picture, home: Path) -> ink.Picture:
    """The parts at the same width, one below the other."""
    left, top, right, bottom = picture.box
    rows = []
    for part in picture.parts:
        pixels = cv2.imread(str(home / part))[..., ::-1]
        height, width = pixels.shape[:2]
        pixels = pixels[round(top * height) : round(bottom * height), round(left * width) : round(right * width)]
        height = round(pixels.shape[0] * picture.width / pixels.shape[1])
        rows += [ink.to_bytes(ink.resized(pixels, picture.width, height)), ink.blank(GAP, picture.width, ink.WHITE)]
    return np.ascontiguousarray(np.vstack(rows[:-1]))


def save(name: str, pixels: ink.Picture) -> None:
    """Write a picture of the documentation."""
    write_picture(str(FOLDER / f"{name}.jpg"), pixels, quality=QUALITY)


if __name__ == "__main__":
    main()
