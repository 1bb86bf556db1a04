"""Hugin's command-line tools on photos in memory, and the cameras they find.

This reader of .pto files is the judge of Hugin and shares nothing with the one in `io`. Angles are degrees there: yaw
right, pitch up, roll clockwise, as ours. The lens has the field of view v over the photo's width, and a polynomial
`r' = (a r^3 + b r^2 + c r + 1 - a - b - c) r` from the ideal to the true radius, in units of half the shorter side.
"""

import re
import shutil
import subprocess
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational

from panostitch.geometry.rotation import from_angles
from panostitch.model.photo import Photo

Floats = NDArray[np.float64]

HUGIN = "Hugin"
TOOLS = ("pto_gen", "cpfind", "cpclean", "autooptimiser", "pto_var")
STITCHING_TOOLS = ("pano_modify", "hugin_executor", "nona", "enblend")
INSTALL = "apt install hugin-tools enblend"
GUESS = 50  # degrees, what pto_gen itself assumes of the field of view where metadata tell nothing
FULL_FRAME_DIAGONAL = 43.27  # mm
TIMEOUT = 1800  # s, for one tool
NEWTON_STEPS = 20
PLAIN, LENS, CANVAS = "plain.pto", "lens.pto", "canvas.pto"
PANORAMA = "panorama.tif"
RECTILINEAR = 0
LAST_WORDS = 300  # characters of what a tool said before it failed


class HuginError(Exception):
    """A tool of Hugin's failed, or left something that is not understood."""


@dataclass(frozen=True)
class HuginCamera:
    """A camera as Hugin has it; see `panostitch.model.camera` for what the methods do.

    size:           (width, height) px
    focal:          px
    centre:         (x, y) px of the principal point
    cam_from_world: (3, 3)
    abc:            coefficients of the polynomial
    """

    size: tuple[int, int]
    focal: float
    centre: tuple[float, float]
    cam_from_world: Floats
    abc: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def project(self, rays: Floats) -> Floats:
        """Rays of the world (n, 3) to pixels (n, 2); NaN behind the camera."""
        local = rays @ self.cam_from_world.T
        depth = np.where(local[:, 2:] > 1e-9, local[:, 2:], np.nan)
        ideal = local[:, :2] / depth * self.focal
        return np.asarray(ideal * self._factor(np.hypot(*ideal.T) / self._unit)[:, None] + self.centre)

    def rays(self, xy: Floats) -> Floats:
        """Pixels (n, 2) to rays of the world (n, 3), not of unit length."""
        seen = np.asarray(xy, np.float64) - self.centre
        radius = np.hypot(*seen.T) / self._unit
        ideal = seen * (self._ideal(radius) / np.maximum(radius, 1e-12))[:, None]
        return np.asarray(np.column_stack([ideal, np.full(len(ideal), self.focal)]) @ self.cam_from_world)

    @property
    def _unit(self) -> float:
        return min(self.size) / 2

    def _factor(self, radius: Floats) -> Floats:
        a, b, c = self.abc
        return np.asarray(((a * radius + b) * radius + c) * radius + 1 - a - b - c)

    def _ideal(self, radius: Floats) -> Floats:
        """The radii (n,) that the lens moves to these, by Newton's method; NaN where there are none."""
        a, b, c = self.abc
        ideal = radius.copy()
        for _ in range(NEWTON_STEPS):
            slope = ((4 * a * ideal + 3 * b) * ideal + 2 * c) * ideal + 1 - a - b - c
            ideal = ideal - (ideal * self._factor(ideal) - radius) / np.where(np.abs(slope) > 1e-6, slope, 1e-6)
        return np.where(np.abs(ideal * self._factor(ideal) - radius) < 1e-6, ideal, np.nan)


@dataclass(frozen=True)
class HuginResult:
    """What Hugin made of the photos.

    plain, lens: cameras as `autooptimiser -a` leaves them, and with the lens optimised after that; None for a photo
                 that no control points join to the others
    seconds:     of all tools together
    """

    plain: tuple[HuginCamera | None, ...]
    lens: tuple[HuginCamera | None, ...]
    seconds: float


def is_installed() -> bool:
    """Whether all of the tools that align photos are on the path."""
    return not missing_tools(TOOLS)


def missing_tools(tools: Sequence[str] = TOOLS + STITCHING_TOOLS) -> list[str]:
    """Those of the tools that are not on the path."""
    return [tool for tool in tools if not shutil.which(tool)]


def version() -> str:
    """Hugin's version, as its tools state it; empty where they do not."""
    said = subprocess.run(["nona", "--help"], capture_output=True, check=False, timeout=TIMEOUT)
    found = re.search(r"version (\S+)", (said.stdout + said.stderr).decode(errors="replace"))
    return found[1] if found else ""


def run_hugin(photos: Sequence[Photo], folder: str | Path, *, threads: int = 1) -> HuginResult:
    """Let Hugin align the photos, in an existing folder of its own. Raises HuginError where it fails."""
    home = Path(folder)
    names = [f"{number:03d}.png" for number in range(len(photos))]
    for photo, name in zip(photos, names, strict=True):
        Image.fromarray(photo.source.read()[0]).save(home / name, exif=exif_of(photo), compress_level=1)
    start = time.perf_counter()
    for command in _commands(names, known=all(photo.focal for photo in photos), threads=threads):
        _run(command, home, command[command.index("-o") + 1])
    seconds = time.perf_counter() - start
    plain, lens = (read_pto((home / name).read_text()) for name in (PLAIN, LENS))
    if {len(plain), len(lens)} != {len(photos)}:
        raise HuginError(f"Hugin speaks of {len(plain)} and {len(lens)} photos where {len(photos)} were given")
    return HuginResult(plain, lens, seconds)


def stitch_hugin(folder: str | Path, project: str = PLAIN) -> NDArray[np.uint8]:
    """The panorama (h, w, 4) RGBA that Hugin makes in the folder where it has aligned photos, without empty borders.

    Raises HuginError.
    """
    home = Path(folder)
    _run(["pano_modify", "--center", "--fov=AUTO", "--canvas=AUTO", "-o", CANVAS, project], home, CANVAS)
    prefix = PANORAMA.removesuffix(".tif")
    _run(["hugin_executor", "--stitching", f"--prefix={prefix}", CANVAS], home, PANORAMA)
    with Image.open(home / PANORAMA) as picture:
        pixels = np.asarray(picture.convert("RGBA"), np.uint8)
    rows, columns = (np.flatnonzero((pixels[..., 3] > 0).any(axis)) for axis in (1, 0))
    if not len(rows):
        raise HuginError("enblend left an empty picture")
    return np.ascontiguousarray(pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])


def _commands(names: Sequence[str], *, known: bool, threads: int) -> list[list[str]]:
    """The tools in their order, each with its arguments; `known` is whether the photos tell their focal length."""
    view = [] if known else ["-f", str(GUESS)]
    return [
        ["pto_gen", *view, "-o", "photos.pto", *names],
        ["cpfind", "--multirow", "--ncores", str(threads), "-o", "points.pto", "photos.pto"],
        ["cpclean", "-o", "clean.pto", "points.pto"],
        ["autooptimiser", "-a", "-m", "-l", "-s", "-o", PLAIN, "clean.pto"],
        ["pto_var", "--opt=y,p,r,v,a,b,c", "-o", "variables.pto", PLAIN],
        ["autooptimiser", "-n", "-o", LENS, "variables.pto"],
    ]


def _run(command: Sequence[str], home: Path, written: str) -> None:
    try:
        done = subprocess.run(
            command, cwd=home, stdin=subprocess.DEVNULL, capture_output=True, timeout=TIMEOUT, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise HuginError(f"{command[0]} took more than {TIMEOUT} s") from error
    if done.returncode or not (home / written).exists():
        said = " ".join((done.stdout + done.stderr).decode(errors="replace").split())
        raise HuginError(f"{command[0]} failed with code {done.returncode}: {said[-LAST_WORDS:]}")


def exif_of(photo: Photo) -> Image.Exif:
    """Metadata that tell the focal length of a photo, where it is known."""
    exif = Image.Exif()
    if photo.focal:
        length = photo.focal / np.hypot(*photo.size) * FULL_FRAME_DIAGONAL
        exif[ExifTags.Base.Make], exif[ExifTags.Base.Model] = "synthetic", photo.lens or "camera"
        tags = exif.get_ifd(ExifTags.IFD.Exif)
        tags[ExifTags.Base.FocalLength] = IFDRational(round(length * 10), 10)
        tags[ExifTags.Base.FocalLengthIn35mmFilm] = round(length)
    return exif


def read_pto(text: str) -> tuple[HuginCamera | None, ...]:
    """Cameras of the photos in a .pto file; None for those outside the largest group that control points join.

    Raises HuginError for lenses other than rectilinear ones.
    """
    images: list[dict[str, float]] = []
    links: list[tuple[int, int]] = []
    for line in text.splitlines():
        if line.startswith("i "):
            images.append(_variables(line, images))
        elif line.startswith("c "):
            numbers = dict(re.findall(r" ([nN])(\d+)", line))
            links.append((int(numbers["n"]), int(numbers["N"])))
    joined = _largest_group(len(images), links)
    return tuple(_camera(image) if n in joined else None for n, image in enumerate(images))


def _variables(line: str, earlier: Sequence[dict[str, float]]) -> dict[str, float]:
    """Variables of an image; `v=0` is the v of image 0."""
    # the name of the file comes last and may hold anything
    found = re.findall(r" ([A-Za-z]+)(=?)(-?[\d.]+(?:[eE][-+]?\d+)?)", line.split(' n"')[0])
    return {name: earlier[int(value)][name] if linked else float(value) for name, linked, value in found}


def _camera(image: dict[str, float]) -> HuginCamera:
    if image["f"] != RECTILINEAR:
        raise HuginError(f"lens type {image['f']:g} is not understood")
    size = (int(image["w"]), int(image["h"]))
    yaw, pitch, roll, view = (float(np.deg2rad(image[name])) for name in "yprv")
    centre = ((size[0] - 1) / 2 + image.get("d", 0.0), (size[1] - 1) / 2 + image.get("e", 0.0))
    a, b, c = (image.get(name, 0.0) for name in "abc")
    focal = size[0] / 2 / float(np.tan(view / 2))
    return HuginCamera(size, focal, centre, from_angles(yaw, pitch, roll), (a, b, c))


def _largest_group(count: int, links: Sequence[tuple[int, int]]) -> set[int]:
    """Numbers of the images in the largest connected group; none where no two are connected."""
    group = list(range(count))
    for i, j in links:
        old, new = group[j], group[i]
        group = [new if g == old else g for g in group]
    ((largest, size),) = Counter(group).most_common(1) or [(0, 0)]
    return {n for n, g in enumerate(group) if g == largest} if size > 1 else set()
