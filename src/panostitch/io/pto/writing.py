"""An alignment as a .pto file."""

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from panostitch.errors import UsageError
from panostitch.geometry import rotation
from panostitch.io.atomic import write_bytes
from panostitch.io.pto import flat, lens
from panostitch.io.pto.canvas import HuginCanvas, place, place_flat
from panostitch.io.pto.frame import Frame, frame_of
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas, Region
from panostitch.model.light import GAMMA, TERMS, Light, unchanged
from panostitch.model.photo import Photo

Floats = NDArray[np.float64]

POOR = 0.5  # px: a fit that is worse than this shows in the panorama
# Hugin's model of a camera's tone curve (EMoR, Grossberg & Nayar 2003): with these five numbers it comes within 2.3
# grey levels of a power law of GAMMA (least squares), under which exposure is the gain that it is with us. Its default,
# all zero, is another curve: it would even out half as much again.
TONE_CURVE = (-0.0157, -1.1816, -0.2806, -0.1493, -0.124)
FORBIDDEN = ('"', "\n", "\r")  # in a name: a .pto file knows no escapes
LENS = ("v", "Ra", "Rb", "Rc", "Rd", "Re", "a", "b", "c", "d", "e", "Va", "Vb", "Vc", "Vd", "Vx", "Vy")
TURN = ("r", "p", "y")
PLACE = ("TrX", "TrY", "TrZ")


@dataclass(frozen=True)
class Exactness:
    """How well Hugin's cameras are ours, px at most; plane: of a flat subject, else None."""

    lens: float
    plane: float | None = None

    @property
    def poor(self) -> bool:
        """Whether the difference shows."""
        return max(self.lens, self.plane or 0.0) > POOR

    def __str__(self) -> str:
        if self.plane is not None:
            return f"Hugin's mosaic of cameras before a plane is our homographies to {self.plane:.3f} px"
        return f"Hugin's a, b, c are our lens to {self.lens:.3f} px"


@dataclass(frozen=True)
class _Image:
    """What stands on an i-line: the stored (width, height) px, its parameters by Hugin's names, the file."""

    size: tuple[int, int]
    values: dict[str, float]
    path: str

    @property
    def lens(self) -> tuple[object, ...]:
        """Images that agree in this share a lens."""
        return (self.size, *(self.values[name] for name in LENS))


def check_photos(photos: Sequence[Photo]) -> None:
    """Raise UsageError where Hugin could not be told of a photo; before any work is done."""
    for photo in photos:
        frame_of(photo)
        if any(character in photo.path for character in FORBIDDEN):
            raise UsageError(f"{photo.path}: a .pto file cannot hold this name", hint="rename the photo")


def write_pto(
    alignment: Alignment, path: str, canvas: Canvas, *, crop: Region | None = None, light: Light | None = None
) -> Exactness:
    """Write an alignment for Hugin, with the panorama that we would make of it; how exact Hugin's cameras are.

    crop:  part of the canvas that is kept; None for all of it
    light: what makes the photos equally bright; its fall-off as nearly as Hugin's polynomial is ours

    Raises OutputError, and UsageError for what a .pto file cannot hold.
    """
    check_photos(alignment.photos)
    frames = [frame_of(photo) for photo in alignment.photos]
    plain = [replace(camera, mesh=None) for camera in alignment.cameras]  # Hugin knows nothing like it
    cameras = [frame.stored_camera(camera) for frame, camera in zip(frames, plain, strict=True)]
    describe = _flat if alignment.model != "rotation" else _around
    panorama, geometry, exactness = describe(alignment, cameras, canvas, crop or canvas.region)
    light = light or unchanged(len(cameras))
    folder = os.path.abspath(os.path.dirname(path) or ".")
    images = [
        _Image(camera.size, {**_LIGHT, **_photometry(light, n), **values}, _relative(photo.path, folder))
        for n, (camera, values, photo) in enumerate(zip(cameras, geometry, alignment.photos, strict=True))
    ]
    lines = [*_head(panorama, exactness), *_i_lines(images), *_v_lines(images), *_c_lines(alignment, frames), ""]
    write_bytes(path, os.fsencode("\n".join(lines)))
    return exactness


_LIGHT = {
    **dict(zip(("Ra", "Rb", "Rc", "Rd", "Re"), TONE_CURVE, strict=True)),
    **dict.fromkeys(("Er", "Eb", "Va"), 1.0),
    **dict.fromkeys(("Vb", "Vc", "Vd", "Vx", "Vy", "g", "t", "j"), 0.0),
    "Vm": 5.0,
}
FALL_OFF_RADII = 100  # at which Hugin's fall-off is fitted to ours


def _photometry(light: Light, photo: int) -> dict[str, float]:
    """Exposure value, white balance and fall-off. Hugin divides red and blue by Er and Eb, and all by the fall-off."""
    red, green, blue = (float(gain) for gain in light.gains[photo])
    values = {"Eev": GAMMA * math.log2(green), "Er": (green / red) ** GAMMA, "Eb": (green / blue) ** GAMMA}
    if light.has_fall_off(photo):
        square = np.linspace(0, 1, FALL_OFF_RADII)
        left = light.brightening(photo, square) ** -GAMMA
        terms = np.linalg.lstsq(square[:, None] ** np.arange(1, TERMS + 1), left - 1, rcond=None)[0]
        values |= dict(zip(("Vb", "Vc", "Vd"), map(float, terms), strict=True))
    return values


_STILL = dict.fromkeys(("TrX", "TrY", "TrZ", "Tpy", "Tpp"), 0.0)


def _around(
    alignment: Alignment, cameras: Sequence[Camera], canvas: Canvas, crop: Region
) -> tuple[HuginCanvas, list[dict[str, float]], Exactness]:
    """The panorama, the cameras' parameters and their exactness, of views from one point."""
    del alignment
    panorama = place(canvas, crop)
    ahead = rotation.exp(np.array([0.0, panorama.yaw, 0.0]))
    lenses = [lens.to_hugin(camera) for camera in cameras]
    geometry = [
        {
            "v": _hfov(camera.size[0], found.focal),
            **angles(camera.cam_from_world @ ahead),
            **_STILL,
            "a": found.a,
            "b": found.b,
            "c": found.c,
            "d": camera.centre[0] - (camera.size[0] - 1) / 2,
            "e": camera.centre[1] - (camera.size[1] - 1) / 2,
        }
        for camera, found in zip(cameras, lenses, strict=True)
    ]
    return panorama, geometry, Exactness(max(found.error for found in lenses))


def _flat(
    alignment: Alignment, cameras: Sequence[Camera], canvas: Canvas, crop: Region
) -> tuple[HuginCanvas, list[dict[str, float]], Exactness]:
    """The same of a flat subject."""
    if any(camera.k1 or camera.k2 for camera in cameras):
        raise UsageError("photos of a flat subject with a lens that distorts cannot be written for Hugin")
    view = flat.reference(cameras)
    # Hugin's straight ahead is the middle of a whole number of pixels
    ahead = np.rint(2 * (np.array(view.ahead) * canvas.scale - canvas.origin)) / 2
    x, y = (ahead + canvas.origin) / canvas.scale
    known = [photo.focal for photo in alignment.photos if photo.focal and max(photo.size) == view.side]
    view = flat.View((float(x), float(y)), view.pixel, view.side)
    found = flat.mosaic(cameras, view, hint=known[0] if known else None)
    distance = canvas.scale * found.focal * view.pixel
    panorama = place_flat(canvas, crop, ahead=(float(ahead[0]), float(ahead[1])), distance=distance)
    tilt = angles(_looking(found.normal))
    geometry = [
        {
            "v": _hfov(camera.size[0], found.focal * max(camera.size) / view.side),
            **angles(turn),
            **dict(zip(PLACE, spot * [1, 1, -1], strict=True)),
            "Tpy": tilt["y"],
            "Tpp": tilt["p"],
            **dict.fromkeys("abcde", 0.0),
        }
        for camera, turn, spot in zip(cameras, found.turns, found.places, strict=True)
    ]
    return panorama, geometry, Exactness(0.0, found.error)


def angles(cam_from_world: Floats) -> dict[str, float]:
    """Hugin's yaw, pitch and roll in degrees of a rotation (3, 3): geometry.rotation.from_angles backwards."""
    ahead = cam_from_world[2]
    yaw = math.atan2(ahead[0], ahead[2])
    pitch = math.atan2(-ahead[1], math.hypot(ahead[0], ahead[2]))
    rolled = cam_from_world @ rotation.from_angles(yaw, pitch, 0.0).T
    return {"r": math.degrees(math.atan2(rolled[0, 1], rolled[0, 0])), "p": math.degrees(pitch), "y": math.degrees(yaw)}


def _looking(normal: Floats) -> Floats:
    """A rotation (3, 3) whose straight ahead is this unit vector (3,)."""
    across = np.cross([0.0, 1.0, 0.0], normal)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(normal, across), normal])


def _hfov(width: int, focal: float) -> float:
    return math.degrees(2 * math.atan(width / 2 / focal))


def _relative(photo: str, folder: str) -> str:
    return os.path.relpath(os.path.abspath(photo), folder)


def _head(panorama: HuginCanvas, exactness: Exactness) -> Iterator[str]:
    crop, (width, height) = panorama.crop, panorama.size
    yield "# hugin project file"
    yield "#hugin_ptoversion 2"
    yield f"# written by panostitch; {exactness}"
    if exactness.poor:
        yield f"# this is worse than {POOR} px: Hugin's panorama will differ visibly"
    words = " ".join(map(_number, panorama.parameters))
    parameters = f'P"{words}" ' if words else ""
    yield (
        f"p f{panorama.projection} w{width} h{height} v{_number(panorama.hfov)} k0 E0 R0 {parameters}"
        f'S{crop.x},{crop.right},{crop.y},{crop.bottom} n"TIFF_m c:LZW r:CROP"'
    )
    yield "m i0"


def _i_lines(images: Sequence[_Image]) -> Iterator[str]:
    """All parameters stand before the name, where Hugin, which looks for ` v` and the like, finds them first."""
    first: dict[tuple[object, ...], int] = {}
    for number, image in enumerate(images):
        owner = first.setdefault(image.lens, number)
        words = [
            f"{name}={owner}" if name in LENS and owner != number else f"{name}{_number(value)}"
            for name, value in image.values.items()
        ]
        yield f'i w{image.size[0]} h{image.size[1]} f0 {" ".join(words)} n"{image.path}"'


def _v_lines(images: Sequence[_Image]) -> Iterator[str]:
    """What Hugin is to adjust if it is asked to: every camera but the first."""
    moving = any(image.values[name] for image in images for name in PLACE)
    for number in range(1, len(images)):
        for name in (*TURN, *(PLACE if moving else ())):
            yield f"v {name}{number}"
    yield "v"


def _c_lines(alignment: Alignment, frames: Sequence[Frame]) -> Iterator[str]:
    for points in alignment.control_points:
        stored = np.hstack([frames[points.i].stored(points.xy_i), frames[points.j].stored(points.xy_j)])
        for x, y, other_x, other_y in stored:
            yield f"c n{points.i} N{points.j} x{x:.4f} y{y:.4f} X{other_x:.4f} Y{other_y:.4f} t0"


def _number(value: float) -> str:
    return f"{value + 0.0:.12g}"
