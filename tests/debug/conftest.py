"""A small made-up run: three photos in memory and all the events that stages send."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from panostitch.geometry import rotation
from panostitch.model.alignment import Alignment, LeftOut, LinkSummary
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.features import Features
from panostitch.model.light import Light
from panostitch.model.match import Groups, PutativeMatch, Rejection, VerifiedMatch
from panostitch.model.photo import Photo


@dataclass(frozen=True)
class Gradient:
    """A source that is never on disk; pixel (x, y) of the full size is (x, y, 90) modulo 256."""

    size: tuple[int, int]

    def read(self, scale: float = 1.0) -> tuple[Any, None]:
        width, height = (max(1, round(n * scale)) for n in self.size)
        y, x = np.mgrid[:height, :width] / scale
        return np.stack([x % 256, y % 256, np.full_like(x, 90)], axis=-1).astype(np.uint8), None


def make_photo(name: str, size: tuple[int, int] = (240, 180)) -> Photo:
    return Photo(name, size, Gradient(size))


def make_features(count: int, size: tuple[int, int] = (240, 180), seed: int = 0) -> Features:
    rng = np.random.default_rng(seed)
    xy = rng.uniform((0, 0), size, (count, 2)).astype(np.float32)
    ones = np.ones(count, np.float32)
    return Features(xy, 5 * ones, ones, rng.uniform(size=count).astype(np.float32), np.zeros((count, 8), np.uint8), 1.0)


def make_pair(i: int, j: int, features: list[Features], inliers: int, *, needed: int = 0) -> tuple[Any, Any]:
    """A putative match, and a link if nothing more is needed, else a rejection."""
    raw = np.repeat(np.arange(min(len(features[i]), len(features[j])), dtype=np.int32)[:, None], 2, axis=1)
    pairs = raw[: inliers + 2]
    if needed:
        return PutativeMatch(i, j, raw, pairs), Rejection(i, j, "too few agree", len(pairs), inliers, needed)
    xy_i, xy_j = (features[k].xy[pairs[:inliers, 0]].astype(np.float64) for k in (i, j))
    return PutativeMatch(i, j, raw, pairs), VerifiedMatch(
        i, j, xy_i, xy_j, np.eye(3), len(pairs), 0.4, float("nan"), len(pairs)
    )


@dataclass(frozen=True)
class Run:
    """Sends events of a run with photos of these names; the last photo belongs to no panorama."""

    names: tuple[str, ...] = ("a.jpg", "b.jpg", "c.jpg")
    photo_size: tuple[int, int] = (240, 180)
    canvas_size: tuple[int, int] = (400, 200)

    @property
    def photos(self) -> list[Photo]:
        return [make_photo(name, self.photo_size) for name in self.names]

    def send(self, trace: Callable[..., None]) -> None:
        self.send_align(trace)
        self.send_render(trace)

    def send_align(self, trace: Callable[..., None]) -> None:
        photos = self.photos
        features = [make_features(40, self.photo_size, seed=k) for k in range(len(photos))]
        trace("photos.read", photos=photos)
        for index, photo in enumerate(photos):
            trace("features.detected", index=index, photo=photo, features=features[index])
        links = []
        for i, j, inliers, needed in ((0, 1, 20, 0), (0, 2, 6, 12), (1, 2, 1, 12)):
            match, link = make_pair(i, j, features, inliers, needed=needed)
            trace("matching.matched", photos=photos, features=features, match=match)
            trace("matching.linked", photos=photos, features=features, match=match, link=link)
            links.append(link)
        trace("matching.grouped", photos=photos, links=links, groups=Groups(((0, 1),), (2,)))
        alignment = self.alignment
        trace(
            "alignment.solved",
            alignment=alignment,
            residuals={"rms": np.float64(0.5), "p95": 1.25},
        )
        trace("layout.chosen", alignment=alignment, canvas=self.canvas, reason="wide")

    def send_render(self, trace: Callable[..., None]) -> None:
        photos, (width, height) = self.photos[:2], self.canvas_size
        picture = np.full((height, width, 3), 100, np.float32)
        labels = np.zeros((height, width), np.int16)
        labels[:, width // 2 :] = 1
        labels[:10] = -1
        for index, photo in enumerate(photos):
            piece = picture[:50, :50]
            layers = [Layer(Region(-5, 0, piece.shape[1], len(piece)), piece, np.ones(piece.shape[:2], np.bool_))]
            trace("compositing.warped", index=index, photo=photo, layers=layers, canvas=self.canvas)
        trace(
            "compositing.exposed",
            photos=photos,
            light=Light(np.array([[0.9] * 3, [np.nan] * 3]), np.zeros((2, 3)), "as asked"),
            before=picture,
            after=picture,
        )
        trace("compositing.seamed", labels=labels, picture=picture, names=[photo.name for photo in photos])
        trace("compositing.band", level=0, levels=2, pixels=picture - 100, lowpass=False)
        trace("compositing.band", level=1, levels=2, pixels=picture[::8, ::8], lowpass=True)
        crop = Region(10, 20, width - 30, height - 40)
        trace("compositing.cropped", picture=picture, coverage=labels >= 0, crop=crop, reason="no empty corners")
        trace("panorama.written", path="out.jpg", size=self.canvas_size, preview=picture.astype(np.uint8))

    @property
    def canvas(self) -> Canvas:
        width, height = self.canvas_size
        return Canvas("cylindrical", width / 2.0, (-width / 2.0, -height / 2.0), self.canvas_size)

    @property
    def alignment(self) -> Alignment:
        width, height = self.photo_size
        cameras = tuple(
            Camera(self.photo_size, 1.2 * width, (width / 2, height / 2), rotation.from_angles(yaw, 0.1, -0.2))
            for yaw in (-0.3, 0.3)
        )
        left_out = tuple(LeftOut(name, "overlaps nothing") for name in self.names[2:])
        links = (LinkSummary(0, 1, 20, 0.5),)
        return Alignment("rotation", tuple(self.photos[:2]), cameras, links, left_out, 0.5, 1.25, "fits best")


@pytest.fixture(scope="session")
def run() -> Run:
    return Run()


@pytest.fixture(scope="session")
def make() -> Any:
    """The makers above, as attributes."""

    class Make:
        photo = staticmethod(make_photo)
        features = staticmethod(make_features)
        pair = staticmethod(make_pair)
        run = Run

    return Make
