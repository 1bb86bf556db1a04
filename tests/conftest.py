"""What all tests share: a seeded generator and small photographs of a made-up world."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource, photograph
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene

Pixels = NDArray[np.uint8]

SEED = 1905
VIEW_SIZE = (400, 300)
VIEW_HFOV = np.deg2rad(50)
# three that overlap by two thirds, one that sees something else; together the three are 84 degrees wide, clear of the
# 94 degrees beyond which `auto` takes another projection
VIEW_YAWS = np.deg2rad([0, 17, 34, 130])


@pytest.fixture
def rng() -> np.random.Generator:
    """The same numbers in every run."""
    return np.random.default_rng(SEED)


@pytest.fixture(scope="session")
def views() -> list[Pixels]:
    """Photographs (300, 400, 3): three that overlap in a row, and a last one that overlaps none of them."""
    scene = sphere_scene(procedural_texture(2400, 1200, seed=3))
    cameras = rig(VIEW_YAWS, size=VIEW_SIZE, hfov=VIEW_HFOV)
    return [photograph(scene, camera, supersample=1) for camera in cameras]


@pytest.fixture(scope="session")
def memory_photos(views: list[Pixels]) -> list[Photo]:
    """The views as photos that are on no disk."""
    return [Photo(f"view_{n}", VIEW_SIZE, ArraySource(pixels)) for n, pixels in enumerate(views)]


@pytest.fixture
def save(tmp_path: Path) -> Callable[..., str]:
    """Write RGB pixels to a file below `tmp_path` by Pillow, with its options; the path."""

    def write(name: str, pixels: Pixels, **options: Any) -> str:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(pixels).save(path, **options)
        return str(path)

    return write
