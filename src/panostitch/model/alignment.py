"""The result of the align half: which photo sees which rays, and what was left out and why."""

import os
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np

from panostitch.errors import InputError
from panostitch.model.camera import Camera
from panostitch.model.finding import Finding
from panostitch.model.match import ControlPoints
from panostitch.model.mesh import mesh_from_json
from panostitch.model.photo import Photo

Model = Literal["rotation", "similarity", "affine", "homography"]

FORMAT = "panostitch alignment"
FORMAT_VERSION = 4

UNREADABLE = "unreadable"  # the cause of photos that were left out because their pixels cannot be had


@dataclass(frozen=True)
class LeftOut:
    """A photo that is not in the panorama, with the reason and the evidence for the user.

    cause: a name in `diagnosis.CAUSES`, or UNREADABLE; empty where nothing was found out, or need not be
    """

    name: str
    reason: str
    details: tuple[str, ...] = ()
    hint: str = ""
    cause: str = ""

    @classmethod
    def unreadable(cls, error: InputError, name: str = "") -> Self:
        """A photo that cannot be read; the error begins with its path, of which the last part is its name."""
        path, _, reason = error.message.partition(": ")
        return cls(name or os.path.basename(path), reason or error.message, error.details, error.hint, UNREADABLE)


@dataclass(frozen=True)
class LinkSummary:
    """One link between photos of the alignment: indices into it, matches used, rms px under the cameras."""

    i: int
    j: int
    matches: int
    rms: float


@dataclass(frozen=True)
class PairTried:
    """What came of a pair of photos (names) whose features were compared.

    matches: by descriptors alone
    inliers: those of them that one homography explains
    needed:  how many would have made a link; 0 where there is one
    overlap: share of the smaller photo, 0 to 1
    error:   rms px of the inliers under the homography; 0 without a link
    verdict: why there is no link; empty where there is one
    """

    first: str
    second: str
    first_features: int
    second_features: int
    matches: int
    inliers: int
    needed: int
    overlap: float
    error: float
    verdict: str


@dataclass(frozen=True)
class Uncertainty:
    """Standard errors of a camera, from the normal equations: its direction (radians) and its focal length (px)."""

    turn: float
    focal: float


@dataclass(frozen=True)
class LocalWarp:
    """Whether the cameras have meshes, and what these gain, or would have gained.

    The figures are of matches that the meshes were not fitted to: how far the matches are off without meshes, and bent.

    used:        the cameras have meshes
    matches:     how many were held back
    rms, median: px, without meshes
    bent_rms, bent_median: px, with meshes
    """

    used: bool
    matches: int
    rms: float
    median: float
    bent_rms: float
    bent_median: float


@dataclass(frozen=True)
class Alignment:
    """Cameras of photos that form one panorama.

    model:    what the photos were taken to be: views from one point (rotation), or of a flat subject from straight
              before it (similarity), from far away (affine) or from anywhere (homography)
    photos, cameras: in the same order
    links:    the pairs that hold it together
    dropped:  pairs that matched, but contradict all others
    left_out: photos that were given but are not part of it
    rms, p95: of the distance of the control points under the cameras, without their meshes, full-resolution px
    reason:   why this model was taken, one sentence
    control_points: what the cameras rest on, pair by pair as in `links`
    held_back_rms, held_back_p95: the same as rms and p95, of control points that the cameras were not adjusted to;
              None where there were too few to hold any back
    uncertainties: of each camera; empty where they are not known
    pairs:    every pair of photos that was compared, those of photos that were left out included
    findings: why links failed or are weak
    local_warp: what meshes gain; None where the cameras explain everything, or nobody asked
    """

    model: Model
    photos: tuple[Photo, ...]
    cameras: tuple[Camera, ...]
    links: tuple[LinkSummary, ...]
    left_out: tuple[LeftOut, ...]
    rms: float
    p95: float
    reason: str = ""
    dropped: tuple[LinkSummary, ...] = ()
    control_points: tuple[ControlPoints, ...] = ()
    held_back_rms: float | None = None
    held_back_p95: float | None = None
    uncertainties: tuple[Uncertainty, ...] = ()
    pairs: tuple[PairTried, ...] = ()
    local_warp: LocalWarp | None = None
    findings: tuple[Finding, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The content of a project file; paths as the photos have them."""
        return {
            "format": FORMAT,
            "version": FORMAT_VERSION,
            "model": self.model,
            "reason": self.reason,
            "rms": self.rms,
            "p95": self.p95,
            "held_back_rms": self.held_back_rms,
            "held_back_p95": self.held_back_p95,
            "local_warp": self.local_warp and vars(self.local_warp),
            "photos": [
                {
                    "name": photo.name,
                    "path": photo.path,
                    "size": list(photo.size),
                    "focal": camera.focal,
                    "centre": list(camera.centre),
                    "k1": camera.k1,
                    "k2": camera.k2,
                    "cam_from_world": camera.cam_from_world.tolist(),
                    "mesh": camera.mesh and camera.mesh.nodes.tolist(),
                }
                for photo, camera in zip(self.photos, self.cameras, strict=True)
            ],
            "links": [vars(link) for link in self.links],
            "dropped": [vars(link) for link in self.dropped],
            "left_out": [vars(photo) for photo in self.left_out],
            "uncertainties": [vars(one) for one in self.uncertainties],
            "control_points": [
                {"i": points.i, "j": points.j, "xy_xy": np.hstack([points.xy_i, points.xy_j]).round(4).tolist()}
                for points in self.control_points
            ],
            "pairs": [vars(pair) for pair in self.pairs],
            "findings": [vars(finding) for finding in self.findings],
        }


def camera_from_json(data: dict[str, Any]) -> Camera:
    """The camera of one entry of a project file. Nonsense raises KeyError, TypeError, ValueError or OverflowError."""
    matrix = np.array(data["cam_from_world"], np.float64)
    width, height = (int(n) for n in data["size"])
    x, y = (float(n) for n in data["centre"])
    focal, k1, k2 = (float(data[name]) for name in ("focal", "k1", "k2"))
    if matrix.shape != (3, 3) or not np.isfinite([*matrix.flat, x, y, focal, k1, k2]).all() or focal <= 0:
        raise ValueError("camera is not made of finite numbers")
    if abs(np.linalg.det(matrix)) < 1e-12:
        raise ValueError("camera matrix is singular")
    mesh = None if data["mesh"] is None else mesh_from_json(data["mesh"], (width, height))
    return Camera((width, height), focal, (x, y), matrix, k1, k2, mesh)


def control_points_from_json(data: dict[str, Any]) -> ControlPoints:
    """One entry of the control points of a project file. Nonsense raises KeyError, TypeError or ValueError."""
    points = np.array(data["xy_xy"], np.float64).reshape(-1, 4)
    if not np.isfinite(points).all():
        raise ValueError("control points are not finite")
    return ControlPoints(int(data["i"]), int(data["j"]), points[:, :2].copy(), points[:, 2:].copy())
