"""A .pto file as an alignment. What Hugin knows of light, masks and output is not asked for."""

import math
import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from panostitch.errors import InputError, UsageError
from panostitch.geometry import rotation
from panostitch.io.pto import lens
from panostitch.io.pto.frame import Frame, frame_of
from panostitch.io.pto.script import Script, Words, finite, index, read_script
from panostitch.io.readers import open_photo
from panostitch.model.alignment import Alignment, LeftOut, LinkSummary
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints
from panostitch.model.photo import Photo

Floats = NDArray[np.float64]

NOTED = 0.5  # px: from here on it is said that the lens is not quite Hugin's
SHEAR = ("g", "t")
PROJECTIONS = {2: "circular fisheye", 3: "full-frame fisheye", 4: "equirectangular", 1: "cylindrical"}


def read_pto(path: str) -> Alignment:
    """Read a Hugin project and open its photos. Raises InputError."""
    script = read_script(path)
    try:
        return _alignment(script, path)
    except UsageError as error:
        raise InputError(error.message, hint=error.hint) from None
    except (ValueError, OverflowError, ZeroDivisionError, np.linalg.LinAlgError) as error:
        raise InputError(f"{path}: not a sound Hugin project: {error}") from None


def _alignment(script: Script, path: str) -> Alignment:
    used = [n for n in range(len(script.images)) if n not in script.off]
    if not used:
        raise ValueError("all of its photos are switched off")
    photos = [_photo(script.images[n], path) for n in range(len(script.images))]
    frames = [frame_of(photo) for photo in photos]
    for n in used:
        _check_size(script, n, photos[n], frames[n])
    flat = any(script.number(n, name, 0.0) for n in used for name in ("TrX", "TrY", "TrZ"))
    found = [_camera(script, n, frames[n], flat=flat) for n in used]
    unit = found[0][0].focal
    cameras = [
        frames[n].upright_camera(_of_plane(camera, unit) if flat else camera, photos[n].size)
        for n, (camera, _) in zip(used, found, strict=True)
    ]
    points = _control_points(script, used, frames)
    links, rms, p95 = _judged(cameras, points)
    return Alignment(
        model="homography" if flat else "rotation",
        photos=tuple(photos[n] for n in used),
        cameras=tuple(cameras),
        links=links,
        left_out=tuple(LeftOut(photos[n].name, "is switched off in the Hugin project") for n in sorted(script.off)),
        rms=rms,
        p95=p95,
        reason=_reason(path, max(error for _, error in found), masked=script.masked),
        control_points=points,
    )


def _reason(path: str, error: float, *, masked: bool) -> str:
    reason = f"cameras of the Hugin project {os.path.basename(path)}"
    if error > NOTED:
        reason += f"; its lens is k1 and k2 only to {error:.1f} px"
    return reason + ("; its masks and crops of photos are not heeded" if masked else "")


def _photo(words: Words, path: str) -> Photo:
    if not words.get("n"):
        raise ValueError("an image has no file name")
    return open_photo(os.path.normpath(os.path.join(os.path.dirname(path), words["n"])))


def _check_size(script: Script, number: int, photo: Photo, frame: Frame) -> None:
    said = tuple(script.number(number, name) for name in ("w", "h"))
    if said != frame.size:
        raise InputError(
            f"{photo.path}: is {frame.size[0]} x {frame.size[1]} px as stored, the Hugin project was made with "
            f"{said[0]:g} x {said[1]:g}",
            hint="take the photos that the project was made with",
        )


def _camera(script: Script, number: int, frame: Frame, *, flat: bool) -> tuple[Camera, float]:
    """Camera of the stored pixels, for rays of the panorama, and the error px of its lens."""
    _check_kind(script, number)
    value = {name: script.number(number, name, 0.0) for name in ("a", "b", "c", "d", "e")}
    width, height = frame.size
    hfov = script.number(number, "v")
    if not 0 < hfov < 180:
        raise ValueError(f"v of image {number} is {hfov:g} degrees")
    focal = width / 2 / math.tan(math.radians(hfov) / 2)
    centre = ((width - 1) / 2 + value["d"], (height - 1) / 2 + value["e"])
    given = lens.HuginLens(focal, value["a"], value["b"], value["c"])
    ours = lens.from_hugin(given, frame.size, centre)
    yaw, pitch, roll = (math.radians(script.number(number, name)) for name in ("y", "p", "r"))
    matrix = rotation.from_angles(yaw, pitch, roll)
    if flat:
        matrix = matrix @ _plane_from_ray(script, number)
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix)) < 1e-9:
        raise ValueError(f"image {number} sees its plane from the side")
    return Camera(frame.size, ours.focal, centre, matrix, ours.k1, ours.k2), ours.error


def _check_kind(script: Script, number: int) -> None:
    kind = int(script.number(number, "f", 0.0))
    if kind != 0:
        name = PROJECTIONS.get(kind, f"of Hugin's lens type {kind}")
        raise ValueError(f"image {number} is {name}; only rectilinear photos are known")
    if any(script.number(number, name, 0.0) for name in SHEAR):
        raise ValueError(f"image {number} is sheared (g, t), which our cameras are not")


def _plane_from_ray(script: Script, number: int) -> Floats:
    """Matrix (3, 3) from rays of the panorama to those of a camera beside it, by way of the plane: I - T n^T."""
    x, y, z = (script.number(number, name, 0.0) for name in ("TrX", "TrY", "TrZ"))
    yaw, pitch = (math.radians(script.number(number, name, 0.0)) for name in ("Tpy", "Tpp"))
    normal = rotation.from_angles(yaw, pitch, 0.0)[2]
    return np.asarray(np.eye(3) - np.outer([x, y, -z], normal))


def _of_plane(camera: Camera, unit: float) -> Camera:
    """The same camera with focal length 1, for a plane whose coordinates are `unit` for a tangent of 1."""
    f = camera.focal
    matrix = np.diag([f, f, 1.0]) @ camera.cam_from_world @ np.diag([1 / unit, 1 / unit, 1.0])
    return Camera(camera.size, 1.0, camera.centre, matrix, camera.k1 / f**2, camera.k2 / f**4)


def _control_points(script: Script, used: Sequence[int], frames: Sequence[Frame]) -> tuple[ControlPoints, ...]:
    """Points of pairs of different photos; those that Hugin keeps for lines are none."""
    place = {n: k for k, n in enumerate(used)}
    pairs: dict[tuple[int, int], list[tuple[float, ...]]] = {}
    for words in script.points:
        i, j = (index(words.get(name, ""), len(script.images)) for name in ("n", "N"))
        xy = tuple(finite(words.get(name, ""), name) for name in ("x", "y", "X", "Y"))
        if words.get("t", "0") != "0" or i == j or i not in place or j not in place:
            continue
        # pairs are i < j
        pairs.setdefault((min(i, j), max(i, j)), []).append(xy if i < j else xy[2:] + xy[:2])
    return tuple(
        ControlPoints(place[i], place[j], frames[i].upright(at[:, :2]), frames[j].upright(at[:, 2:]))
        for (i, j), at in ((pair, np.array(rows)) for pair, rows in sorted(pairs.items()))
    )


def _judged(cameras: Sequence[Camera], points: Sequence[ControlPoints]) -> tuple[tuple[LinkSummary, ...], float, float]:
    """Links, rms and 95th percentile of the control points' distances (px, in the second photo) under the cameras."""
    links, distances = [], [np.zeros(0)]
    for pair in points:
        seen = cameras[pair.j].project(cameras[pair.i].rays(pair.xy_i))
        distance = np.linalg.norm(seen - pair.xy_j, axis=1)
        distance = distance[np.isfinite(distance)]
        links.append(
            LinkSummary(pair.i, pair.j, len(pair), float(np.sqrt((distance**2).sum() / max(len(distance), 1))))
        )
        distances.append(distance)
    whole = np.concatenate(distances)
    if not len(whole):
        return tuple(links), 0.0, 0.0
    return tuple(links), float(np.sqrt((whole**2).mean())), float(np.percentile(whole, 95))
