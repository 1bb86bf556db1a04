"""Makes the sample photos again: `python samples/make_samples.py`.

With the same versions of Pillow, OpenCV and NumPy the bytes are the same.

Nothing is downloaded: the pictures come with scikit-image, the rest is computed. README.md says whose they are.
"""

from pathlib import Path

import cv2
import numpy as np
from PIL import ExifTags, Image

from panostitch.synthetic.gallery import gallery_texture
from panostitch.synthetic.gallery_walls import mottled, picture
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import plane_scene, rig, sphere_scene, step_for_overlap, view_of_plane

HERE = Path(__file__).parent
SIZE = (900, 675)
QUALITY = 90
NOISE = 1.0  # grey levels
VIGNETTING = 0.2

FOCAL_35MM = 31  # mm
# EXIF compares diagonals (CIPA DCG-001): 43.27 mm on film
FOCAL = FOCAL_35MM / float(np.hypot(36, 24)) * float(np.hypot(*SIZE))  # px
HALL_OVERLAP = 0.38
HALL_PITCHES = (1.2, -0.8, 0.4, -1.4, 0.9)  # degrees
HALL_ROLLS = (-0.9, 0.7, 0.3, -0.6, 1.1)  # degrees
HALL_EXPOSURES = (-0.05, 0.15, -0.12, 0.12, -0.1)  # EV

POSTER = (3200, 2500)  # px, with the wall around it
SHEET = (1880, 1460)  # px
TITLE = "PICTURES FOR EVERYONE"


def make_hall() -> None:
    """Five photos of the gallery, taken by hand from one spot."""
    scene = sphere_scene(gallery_texture(6144))
    hfov = 2 * np.arctan(SIZE[0] / 2 / FOCAL)
    yaws = (np.arange(5) - 2) * step_for_overlap(HALL_OVERLAP, hfov)
    cameras = rig(yaws, np.deg2rad(HALL_PITCHES), np.deg2rad(HALL_ROLLS), size=SIZE, focal=FOCAL, k1=-0.02)
    rng = np.random.default_rng(1)
    for number, (camera, exposure) in enumerate(zip(cameras, HALL_EXPOSURES, strict=True), 1):
        photo = photograph(scene, camera, exposure=exposure, vignetting=VIGNETTING, noise=NOISE, rng=rng)
        save(HERE / "hall" / f"hall_{number}.jpg", photo, exif=hall_exif(number, exposure))


def make_poster() -> None:
    """Two photos of one poster from two places, without metadata: not a turning camera, but a flat subject."""
    scene = plane_scene(poster())
    views = [
        view_of_plane(SIZE, focal=780, at=(-0.36, 0.0, -1.28), turn=(0.01, 0.01, 0.01)),
        view_of_plane(SIZE, focal=780, at=(0.62, -0.03, -1.28), turn=(-0.17, -0.02, -0.02)),
    ]
    rng = np.random.default_rng(2)
    for number, (camera, exposure) in enumerate(zip(views, (0.0, 0.15), strict=True), 1):
        photo = photograph(scene, camera, exposure=exposure, vignetting=VIGNETTING / 2, noise=NOISE, rng=rng)
        save(HERE / "poster" / f"poster_{number}.jpg", photo)


def poster() -> np.ndarray:
    """Six pictures on white paper on a plastered wall (h, w, 3) RGB."""
    width, height = POSTER
    rng = np.random.default_rng(3)
    plaster = np.array([150, 156, 150]) * (1 + 0.07 * mottled(height, width, rng, fall=0.92))[..., None]
    left, top = (width - SHEET[0]) // 2, (height - SHEET[1]) // 2
    right, bottom = left + SHEET[0], top + SHEET[1]
    shadow = np.zeros((height, width), np.float32)
    shadow[top + 20 : bottom + 30, left : right + 12] = 0.5
    sheet = plaster * (1 - cv2.GaussianBlur(shadow, (0, 0), 14))[..., None]
    sheet[top:bottom, left:right] = (242, 238, 228)
    names = (("astronaut", "rocket", "retina"), ("coffee", "hubble_deep_field", "chelsea"))
    wide, high, gap = 580, 600, 35
    for row, line in enumerate(names):
        for column, name in enumerate(line):
            x, y = left + gap + column * (wide + gap), top + 190 + row * (high + gap)
            sheet[y : y + high, x : x + wide] = filling(picture(name), wide, high)
    sheet = np.clip(np.rint(sheet), 0, 255).astype(np.uint8)
    place = left + gap, top + 135
    return cv2.putText(sheet, TITLE, place, cv2.FONT_HERSHEY_DUPLEX, 4.0, (40, 44, 60), 8, cv2.LINE_AA)


def filling(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """The middle of a picture, cut to an aspect and enlarged or reduced to a size."""
    factor = max(width / image.shape[1], height / image.shape[0])
    size = max(width, round(image.shape[1] * factor)), max(height, round(image.shape[0] * factor))
    method = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    scaled = cv2.resize(image, size, interpolation=method)
    x, y = (size[0] - width) // 2, (size[1] - height) // 2
    return scaled[y : y + height, x : x + width]


def hall_exif(number: int, exposure: float) -> Image.Exif:
    """What a small camera would write."""
    exif = Image.Exif()
    exif[ExifTags.Base.Make] = "panostitch"
    exif[ExifTags.Base.Model] = "synthetic"
    exif[ExifTags.Base.Orientation] = 1
    exif.get_ifd(ExifTags.IFD.Exif).update(
        {
            ExifTags.Base.ExposureTime: 2**exposure / 60,
            ExifTags.Base.FNumber: 2.8,
            ExifTags.Base.ISOSpeedRatings: 200,
            ExifTags.Base.DateTimeOriginal: f"2024:05:18 10:30:{2 * number:02d}",
            ExifTags.Base.FocalLength: 6.2,
            ExifTags.Base.FocalLengthIn35mmFilm: FOCAL_35MM,
        }
    )
    return exif


def save(path: Path, pixels: np.ndarray, *, exif: Image.Exif | None = None) -> None:
    """Write a JPEG file."""
    path.parent.mkdir(exist_ok=True)
    options = {"exif": exif} if exif else {}
    Image.fromarray(pixels).save(path, quality=QUALITY, **options)
    print(f"{path.relative_to(HERE)}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    make_hall()
    make_poster()
