"""Photos on disk, and the command line in this process."""

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from panostitch.cli.main import run


@dataclass(frozen=True)
class Result:
    """What a run of the command line left behind."""

    code: int
    out: str
    err: str


@pytest.fixture
def strangers(tmp_path: Path) -> Path:
    """A folder with a.png and b.png, which have nothing in common."""
    folder = tmp_path / "strangers"
    folder.mkdir()
    for name in "ab":
        noise = np.random.default_rng(ord(name)).integers(0, 255, (120, 160, 3), np.uint8)
        Image.fromarray(noise).save(folder / f"{name}.png")
    return folder


@pytest.fixture(scope="session")
def photos(tmp_path_factory: pytest.TempPathFactory, views: list[NDArray[np.uint8]]) -> Path:
    """A folder with a.jpg, b.jpg and c.jpg, which overlap in a row."""
    folder = tmp_path_factory.mktemp("photos")
    for name, pixels in zip("abc", views, strict=False):
        Image.fromarray(pixels).save(folder / f"{name}.jpg", quality=95)
    return folder


@pytest.fixture(scope="session")
def strays(tmp_path_factory: pytest.TempPathFactory, views: list[NDArray[np.uint8]], photos: Path) -> Path:
    """A folder with files that do not fit: lonely.jpg, half.jpg, half.png, empty.jpg, letter.jpg."""
    folder = tmp_path_factory.mktemp("strays")
    Image.fromarray(views[3]).save(folder / "lonely.jpg", quality=95)
    whole = (photos / "b.jpg").read_bytes()
    (folder / "half.jpg").write_bytes(whole[: len(whole) // 2])
    Image.fromarray(views[1]).save(folder / "half.png")
    whole = (folder / "half.png").read_bytes()
    (folder / "half.png").write_bytes(whole[: len(whole) // 2])
    (folder / "empty.jpg").touch()
    (folder / "letter.jpg").write_text("Dear reader,\n" * 50)
    return folder


@pytest.fixture
def call(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[..., Result]:
    """Run the command line with these arguments in `tmp_path`; no run may show a traceback."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path_factory.mktemp("logs")))

    def run_it(*arguments: object, stdin: str = "") -> Result:
        monkeypatch.setattr("sys.stdin", io.StringIO(stdin))
        capsys.readouterr()
        code = run([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return Result(code, out, err)

    return run_it
