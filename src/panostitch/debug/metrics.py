"""The numbers of a run, collected from the events of the stages, as pure JSON."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from panostitch.debug.folder import FORMAT, FORMAT_VERSION
from panostitch.geometry import rotation
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas, Region
from panostitch.model.features import Features
from panostitch.model.finding import Finding
from panostitch.model.light import Light
from panostitch.model.match import Groups, Link, PutativeMatch, VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.model.score import SeamScore


class Metrics:
    """Collects numbers: a method for each event, named like it; photos are known by their names."""

    def __init__(self) -> None:
        self._photos: dict[str, dict[str, Any]] = {}
        self._pairs: dict[tuple[str, str], dict[str, Any]] = {}
        self._parts: dict[str, Any] = {}
        self._sizes: dict[str, Any] = {}

    def as_json(self) -> dict[str, Any]:
        """All numbers so far; contains no NaN and nothing that JSON has no type for."""
        return {
            "format": FORMAT,
            "version": FORMAT_VERSION,
            "photos": pure(list(self._photos.values())),
            "pairs": pure(list(self._pairs.values())),
            **pure(self._parts),
            "sizes": pure(self._sizes),
        }

    def photos_read(self, photos: Sequence[Photo], **_: Any) -> None:
        """Sizes and what was surprising on reading."""
        for photo in photos:
            self._photo(photo)

    def features_detected(self, photo: Photo, features: Features, **_: Any) -> None:
        """Number of key points."""
        self._photo(photo)["key_points"] = len(features)

    def matching_matched(self, photos: Sequence[Photo], match: PutativeMatch, **_: Any) -> None:
        """Matches by descriptors alone, before and after the ratio test."""
        self._pair(photos, match).update(raw=len(match.raw), after_ratio=len(match.pairs))

    def matching_linked(self, photos: Sequence[Photo], match: PutativeMatch, link: Link, **_: Any) -> None:
        """What became of a pair."""
        self.matching_matched(photos, match)
        self._link(photos, link)

    def matching_grouped(self, photos: Sequence[Photo], links: Sequence[Link], groups: Groups, **_: Any) -> None:
        """Which photos belong together; links may have been dropped since they were made."""
        for link in links:
            self._link(photos, link)
        for number, members in enumerate(groups.panoramas, start=1):
            for index in members:
                self._photo(photos[index])["group"] = number
        for index in groups.singles:
            self._photo(photos[index])["group"] = None
        self._parts["groups"] = [[photos[k].name for k in members] for members in groups.panoramas]
        self._parts["singles"] = [photos[k].name for k in groups.singles]

    def diagnosis_explained(self, finding: Finding, **_: Any) -> None:
        """Why a link failed, or is weak."""
        self._parts.setdefault("findings", []).append(vars(finding))

    def alignment_solved(self, alignment: Alignment, residuals: Mapping[str, Any], **_: Any) -> None:
        """Cameras, how well they fit, and how they were found."""
        for photo in alignment.photos:
            self._photo(photo)["used"] = True
        for left_out in alignment.left_out:
            if left_out.name in self._photos:
                self._photos[left_out.name].update(used=False, left_out=left_out.reason)
        self._parts["alignment"] = {
            "model": alignment.model,
            "reason": alignment.reason,
            **{f"{name}_px": value for name, value in residuals.items()},
            "cameras": [
                {"photo": photo.name, **_camera(camera, turned=alignment.model == "rotation")}
                for photo, camera in zip(alignment.photos, alignment.cameras, strict=True)
            ],
            "links": [
                {"photos": [alignment.photos[k.i].name, alignment.photos[k.j].name], "matches": k.matches,
                 "rms_px": k.rms} for k in alignment.links
            ],
        }  # fmt: skip

    def alignment_bent(self, alignment: Alignment, **_: Any) -> None:
        """What meshes gain, and how far they bend each photo."""
        warp = alignment.local_warp
        self._parts["local_warp"] = warp and {
            **vars(warp),
            "largest_px": {
                photo.name: camera.mesh.largest
                for photo, camera in zip(alignment.photos, alignment.cameras, strict=True)
                if camera.mesh
            },
        }

    def layout_chosen(self, canvas: Canvas, reason: str, **_: Any) -> None:
        """The canvas and why."""
        self._parts["canvas"] = {
            "projection": canvas.projection,
            "reason": reason,
            "size": canvas.size,
            "px_per_radian": canvas.scale,
            "origin": canvas.origin,
            "wraps": canvas.wraps,
        }
        self._sizes["canvas"] = canvas.size

    def compositing_warped(self, canvas: Canvas, **_: Any) -> None:
        """Size that the seams and low bands are made at."""
        self._sizes["reduced_canvas"] = canvas.size

    def compositing_exposed(self, photos: Sequence[Photo], light: Light, **_: Any) -> None:
        """Gain of each photo, as a whole and by channel, and the fall-off of its lens."""
        names = [photo.name for photo in photos]
        self._parts["gains"] = dict(zip(names, light.brightness, strict=True))
        self._parts["light"] = {
            "reason": light.reason,
            "channel_gains": dict(zip(names, light.gains, strict=True)),
            "fall_off": dict(zip(names, light.fall_off, strict=True)),
        }

    def compositing_seamed(self, labels: NDArray[np.int16], names: Sequence[str], **_: Any) -> None:
        """Share of the covered canvas that each photo owns."""
        counts = np.bincount(labels[labels >= 0].astype(np.intp), minlength=len(names))
        self._parts["shares"] = {name: counts[k] / max(1, counts.sum()) for k, name in enumerate(names)}

    def compositing_band(self, levels: int, **_: Any) -> None:
        """Number of bands of the blend."""
        self._parts["bands"] = levels

    def compositing_cropped(self, crop: Region, reason: str, coverage: NDArray[np.bool_], **_: Any) -> None:
        """What is written of the canvas, in px of the reduced canvas."""
        self._parts["crop"] = {"reduced_px": vars(crop), "reason": reason, "covered": float(np.mean(coverage))}
        self._sizes["reduced_crop"] = (crop.width, crop.height)

    def scoring_judged(self, seams: Sequence[SeamScore], **_: Any) -> None:
        """The score of each seam."""
        self._parts["seams"] = [seam.to_json() for seam in seams]

    def panorama_written(self, path: str, size: tuple[int, int], **_: Any) -> None:
        """The panorama's file."""
        self._parts["panorama"] = {"path": str(path), "size": size}
        self._sizes["panorama"] = size

    def _photo(self, photo: Photo) -> dict[str, Any]:
        blank: dict[str, Any] = {
            "name": photo.name,
            "size": photo.size,
            "key_points": None,
            "group": None,
            "used": False,
        }
        if photo.notes:
            blank["notes"] = photo.notes
        return self._photos.setdefault(photo.name, blank)

    def _pair(self, photos: Sequence[Photo], pair: PutativeMatch | Link) -> dict[str, Any]:
        names = photos[pair.i].name, photos[pair.j].name
        return self._pairs.setdefault(names, {"photos": names, "raw": None, "after_ratio": None, "linked": False})

    def _link(self, photos: Sequence[Photo], link: Link) -> None:
        verified = isinstance(link, VerifiedMatch)
        self._pair(photos, link).update(
            linked=verified,
            putative=link.putative,
            inliers=link.inliers,
            needed=None if isinstance(link, VerifiedMatch) else link.needed,
            overlap=link.overlap,
            error_px=link.error if isinstance(link, VerifiedMatch) else None,
            reason="" if isinstance(link, VerifiedMatch) else link.reason,
        )


def _camera(camera: Camera, *, turned: bool) -> dict[str, Any]:
    """One camera for people; angles only where its matrix is a rotation."""
    yaw, pitch, roll = angles(camera.cam_from_world) if turned else (None, None, None)
    return {
        "focal_px": camera.focal,
        "centre_px": camera.centre,
        "yaw_degrees": yaw,
        "pitch_degrees": pitch,
        "roll_degrees": roll,
        "k1": camera.k1,
        "k2": camera.k2,
    }


def angles(cam_from_world: NDArray[np.float64]) -> tuple[float, float, float]:
    """Yaw, pitch and roll in degrees of a camera (3, 3): what `rotation.from_angles` made it of."""
    world_from_cam = rotation.nearest(cam_from_world).T
    yaw = math.atan2(world_from_cam[0, 2], world_from_cam[2, 2])
    pitch = math.asin(max(-1.0, min(1.0, -world_from_cam[1, 2])))
    roll = math.atan2(world_from_cam[1, 0], world_from_cam[1, 1])
    return math.degrees(yaw), math.degrees(pitch), math.degrees(roll)


def pure(value: Any) -> Any:
    """The same in types that JSON has: arrays as lists, NaN and infinity as None, what is unknown as text."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, Mapping):
        return {pure(str(key)): pure(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [pure(item) for item in value]
    # names of files that are no valid Unicode arrive as lone surrogates
    return str(value).encode("utf-8", "replace").decode("utf-8")
