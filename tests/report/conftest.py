"""One small run that the tests of the page share: three photos that overlap, one that does not."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from panostitch import pipeline
from panostitch.errors import NoOverlapError
from panostitch.io.writers import write_panorama
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.report import Record, write_report
from panostitch.scoring import score_seams
from panostitch.synthetic.render import ArraySource

HOSTILE = "<script>alert('&\"')</script>.jpg"
# Where the defaults are not the point: a third of the time.
OPTIONS = Options.of(
    detector="orb", max_features=600, retries="none", local_warp="none", seams="voronoi", blender="none", ratio=0.75
)
VIEW_SIZE = (400, 300)


@dataclass(frozen=True)
class Made:
    """A record and the page that was made of it."""

    record: Record
    page: Path

    @property
    def text(self) -> str:
        return self.page.read_text(encoding="utf-8")


def still() -> float:
    """A clock that stands, so that only what should differ can differ."""
    return 0.0


def no_memory() -> int:
    return 1 << 20


def named(views: list[NDArray[np.uint8]], names: tuple[str, ...]) -> list[Photo]:
    return [Photo(name, VIEW_SIZE, ArraySource(pixels)) for name, pixels in zip(names, views, strict=True)]


def stitched(photos: list[Photo], folder: Path) -> Record:
    """The record of a whole run."""
    record = Record(clock=still, resident=no_memory)
    alignment = pipeline.align(photos, OPTIONS, trace=record)
    panorama = pipeline.render(alignment, OPTIONS, trace=record)
    write_panorama(panorama, str(folder / "out.jpg"), OPTIONS.output, trace=record)
    score_seams(panorama, OPTIONS.compositing, trace=record)
    return record


@pytest.fixture(scope="session")
def stitch(tmp_path_factory: pytest.TempPathFactory, views: list[NDArray[np.uint8]]) -> Callable[[], Record]:
    """Makes the run; the second photo has a hostile name."""
    photos = named(views, ("a.jpg", HOSTILE, "c.jpg", "d é.jpg"))
    return lambda: stitched(photos, tmp_path_factory.mktemp("stitched"))


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory, stitch: Callable[[], Record]) -> Made:
    """The page of a run that left one photo out."""
    record, path = stitch(), tmp_path_factory.mktemp("report") / "report.html"
    write_report(record, str(path), OPTIONS)
    return Made(record, path)


@pytest.fixture(scope="session")
def failed(tmp_path_factory: pytest.TempPathFactory, views: list[NDArray[np.uint8]]) -> Made:
    """The page of two photos that do not overlap."""
    photos = named([views[0], views[3]], ("a.jpg", HOSTILE))
    record, path = Record(clock=still, resident=no_memory), tmp_path_factory.mktemp("report") / "failed.html"
    with pytest.raises(NoOverlapError) as caught:
        pipeline.align(photos, OPTIONS, trace=record)
    write_report(record, str(path), OPTIONS, error=caught.value)
    return Made(record, path)


@pytest.fixture(params=["made", "failed"])
def either(request: pytest.FixtureRequest) -> Any:
    """Both pages, one after the other."""
    return request.getfixturevalue(request.param)
