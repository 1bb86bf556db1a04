"""Photos of made-up worlds with known cameras, taken once for all tests of this folder."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from panostitch.model.camera import Camera
from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource, photograph_plan
from panostitch.synthetic.scene import PLANS, Scene, procedural_texture, rig, sphere_scene


@dataclass(frozen=True)
class Known:
    """Photos of a scene and the cameras that took them."""

    scene: Scene
    cameras: list[Camera]
    photos: list[Photo]


def small_row(count=4):
    """A row of 400 x 300 photos that overlap by half; the third one is upright: a shift of all pixels shows."""
    yaws = np.deg2rad(22.0) * (np.arange(count) - (count - 1) / 2)
    pitches, rolls = np.deg2rad([1.0, -2.0, 1.5, -0.5, 2.0, 0.0]), np.deg2rad([1.0, -1.5, 90.0, 2.0, -1.0, 0.0])
    return rig(yaws, pitches[:count], rolls[:count], size=(400, 300), hfov=np.deg2rad(50))


@pytest.fixture(scope="session")
def row() -> Known:
    """Six photos of 1200 x 900, noise-free."""
    scene = sphere_scene(procedural_texture(4096, 2048, seed=7))
    cameras = PLANS["row"]()
    return Known(scene, cameras, photograph_plan(scene, cameras, supersample=1))


@pytest.fixture(scope="session")
def small() -> Known:
    """Four photos of 400 x 300, noise-free."""
    scene = sphere_scene(procedural_texture(2048, 1024, seed=11))
    cameras = small_row()
    return Known(scene, cameras, photograph_plan(scene, cameras, supersample=1))


@pytest.fixture(scope="session")
def elsewhere() -> Known:
    """Three photos of the same kind, of another world."""
    scene = sphere_scene(procedural_texture(2048, 1024, seed=12))
    cameras = small_row(3)
    named = photograph_plan(scene, cameras, supersample=1)
    return Known(scene, cameras, [Photo(f"other_{n}", p.size, p.source) for n, p in enumerate(named)])


@pytest.fixture(scope="session")
def house() -> Known:
    """Three photos of a world whose middle is a wall of tiles all alike; above and below it each thing is unique."""
    rng = np.random.default_rng(0)
    texture = procedural_texture(2048, 1024, seed=20)
    tile = cv2.GaussianBlur(np.kron(rng.uniform(0, 255, (8, 8)), np.ones((8, 8))), (0, 0), 1.5)
    wall = np.tile(tile[..., None], (16, 32, 3)).astype(np.uint8)
    texture[512 - 75 : 512 + 76] = wall[512 - 75 : 512 + 76]
    scene, cameras = sphere_scene(texture), small_row(3)
    return Known(scene, cameras, photograph_plan(scene, cameras, noise=3.0, rng=rng, supersample=1))


@pytest.fixture(scope="session")
def barrel() -> Known:
    """Four photos of 400 x 300 through a lens with strong barrel distortion."""
    scene = sphere_scene(procedural_texture(2048, 1024, seed=11))
    cameras = [replace(camera, k1=-0.12, k2=0.02) for camera in small_row()]
    return Known(scene, cameras, photograph_plan(scene, cameras, supersample=1))


@pytest.fixture(scope="session")
def noise() -> Photo:
    """A photo of nothing."""
    pixels = np.random.default_rng(1).integers(0, 256, (300, 400, 3), np.uint8)
    return Photo("noise", (400, 300), ArraySource(pixels))
