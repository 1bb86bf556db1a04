"""Photographs of known scenes by known cameras: where a point of one is in the other is known exactly."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from time import process_time
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from panostitch.model.camera import Camera
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import Scene, gallery_texture, procedural_texture, rig, sphere_scene
from panostitch.synthetic.textures import even_on_sphere

Floats = NDArray[np.float64]
Grey = NDArray[np.uint8]

SEED = 7
HFOV = np.deg2rad(55)
SCENES = ("hall", "shapes")
FINE, COARSE = 4096, 512  # px, widths of the textures


@dataclass(frozen=True)
class View:
    """A photo in grey (h, w), and the camera that took it."""

    grey: Grey
    camera: Camera


@dataclass(frozen=True)
class Change:
    """What is different in the second photo of a pair; angles in degrees, noise in grey levels, exposure in EV."""

    yaw: float = 0.0
    roll: float = 0.0
    zoom: float = 1.0
    noise: float = 0.0
    exposure: float = 0.0


@dataclass(frozen=True)
class Sweep:
    """Changes one at a time: scenes, size px of the photos, width px of the texture, amounts by the kind of change."""

    worlds: tuple[str, ...] = SCENES
    size: tuple[int, int] = (960, 720)
    texture: int = FINE
    roll: tuple[float, ...] = (0, 15, 30, 45, 60, 75, 90)
    zoom: tuple[float, ...] = (1.0, 1.25, 1.5, 2.0, 2.5)
    noise: tuple[float, ...] = (0, 5, 10, 15, 20)

    def pairs(self, kind: str, yaw: float) -> dict[float, list[list[View]]]:
        """By the amount of a change, a pair of photos of each scene; the second also looks `yaw` degrees aside."""
        return {
            amount: [
                pair(scene(world, self.texture), self.size, Change(yaw=yaw, **{kind: amount})) for world in self.worlds
            ]
            for amount in getattr(self, kind)
        }


TINY_SWEEP = Sweep(("shapes",), (160, 120), COARSE, (0, 45), (1.0, 1.5), (0, 10))
UNITS = {"roll": "roll, degrees", "zoom": "zoom, times", "noise": "noise added, grey levels"}


@cache
def scene(name: str, width: int = FINE) -> Scene:
    """The hall with its pictures, plain walls and repetitions, or a world of shapes with detail everywhere."""
    if name == "hall":
        return sphere_scene(gallery_texture(width))
    return sphere_scene(even_on_sphere(procedural_texture(width, width // 2, SEED)))


def pair(world: Scene, size: tuple[int, int], change: Change, *, yaw: float = 0.0, noise: float = 1.0) -> list[View]:
    """Two photos of a scene; the first looks to `yaw` degrees and has a little noise, as all photos have."""
    changes = [Change(noise=noise), replace(change, noise=float(np.hypot(noise, change.noise)))]
    return [take(world, size, one, yaw=yaw, seed=n) for n, one in enumerate(changes)]


def take(world: Scene, size: tuple[int, int], change: Change, *, yaw: float = 0.0, seed: int = 0) -> View:
    """One photo."""
    (camera,) = rig(np.deg2rad(yaw + change.yaw), 0.0, np.deg2rad(change.roll), size=size, hfov=HFOV)
    camera = replace(camera, focal=camera.focal * change.zoom)
    dice = np.random.default_rng(seed)
    pixels = photograph(world, camera, noise=change.noise, exposure=change.exposure, rng=dice)
    return View(np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), np.uint8), camera)


def truly(first: View, second: View, xy: NDArray[np.floating]) -> Floats:
    """Where points (n, 2) px of the first photo are in the second; NaN where its camera does not see them."""
    there = second.camera.project(first.camera.rays(xy))
    with np.errstate(invalid="ignore"):
        seen = ((there >= 0) & (there <= np.array(second.camera.size) - 1)).all(1)
    return np.asarray(np.where(seen[:, None], there, np.nan))


def nearest(points: Floats, others: NDArray[np.floating]) -> Floats:
    """Distance (n,) px from each of the points (n, 2), NaN for those that are nowhere, to the nearest of others."""
    distance = np.full(len(points), np.nan)
    known = np.isfinite(points).all(1)
    if known.any():
        distance[known] = cKDTree(others).query(points[known])[0] if len(others) else np.inf
    return distance


def repeatability(
    first: View, second: View, xy_i: NDArray[np.floating], xy_j: NDArray[np.floating], px: float
) -> float:
    """Share of the points of the first photo, in sight of the second, that were found there again within `px`.

    Schmid, Mohr & Bauckhage, "Evaluation of interest point detectors", IJCV 2000.
    """
    distance = nearest(truly(first, second, xy_i), xy_j)
    seen = np.isfinite(distance) | np.isinf(distance)
    return float((distance[seen] <= px).mean()) if seen.any() else 0.0


def detailed(width: int) -> list[Grey]:
    """A picture full of detail in grey, and a copy that is reduced to 0.9 and noisy: for many thousand features."""
    grey = cv2.cvtColor(procedural_texture(width, width // 2, SEED), cv2.COLOR_RGB2GRAY)
    small = cv2.resize(grey, None, fx=0.9, fy=0.9, interpolation=cv2.INTER_AREA)
    noisy = small + np.random.default_rng(SEED).normal(0, 3, small.shape)
    return [np.asarray(grey, np.uint8), np.clip(np.rint(noisy), 0, 255).astype(np.uint8)]


def seconds(work: Callable[[], Any], repeats: int) -> float:
    """The least processor time of some calls: what else the machine does is not in it."""
    taken = []
    for _ in range(repeats):
        start = process_time()
        work()
        taken.append(process_time() - start)
    return max(min(taken), 1e-7)


def mean(values: Sequence[float]) -> float:
    """Arithmetic mean; NaN of nothing."""
    return float(np.mean(values)) if len(values) else float("nan")
