"""What rendering and writing cost as the panorama grows: CPU time per megapixel and peak memory, 1 megapixel to above a
gigapixel.

    python benchmarks/scaling.py [--megapixels 1 4 16 64 256 1100] [--output docs/reference/scaling.md]

A flat picture is cut into a grid of JPEG photos that overlap by a quarter; their places are known, so that nothing has
to be aligned. A process of its own makes the panorama, with the default options but for `--compression none`, so that
compressing is not the measure, and from 64 megapixels up with `--max-memory 1G`. It counts its CPU time, on all threads
together, from the first step of the plan to the last byte of the file, and the memory that it held at most. The large
sizes, and one of the small ones, are written as a JPEG too, and that one with `--compression deflate` as well.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from panostitch import pipeline
from panostitch.io.readers import open_photo
from panostitch.io.writers import write_panorama
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.options import Options
from panostitch.runtime.executor import Executor
from panostitch.synthetic.scene import procedural_texture

OVERLAP = 0.25  # of a photo's side
GRIDS = ((2, 2), (6, 3), (32, 4), (128, 6), (512, 11))  # up to so many megapixels, photos a side; above it GRID
GRID = 22
PERIOD = 2048  # px of the texture, which is repeated
QUALITY = 92  # of the photos
BOUNDED_FROM = 64  # megapixels
LIMIT = "1G"
MEASURE = 16  # megapixels of the row that the others are compared with, and that is written in all formats
# a format: the name of its file, and --compression
FORMATS = {
    "TIFF": ("panorama.tif", "none"),
    "JPEG": ("panorama.jpg", "none"),
    "TIFF, deflate": ("panorama.tif", "deflate"),
}
TEXTURE_SEED = 7


@dataclass(frozen=True)
class Row:
    """One panorama: its size px, how many photos, seconds of CPU time for the plan and for the tiles, peak bytes."""

    width: int
    height: int
    photos: int
    photo_side: int
    format: str
    limit: str
    plan: float
    tiles: float
    peak: int

    @property
    def megapixels(self) -> float:
        """Size in millions of pixels."""
        return self.width * self.height / 1e6

    @property
    def per_megapixel(self) -> float:
        """CPU seconds for a megapixel."""
        return (self.plan + self.tiles) / self.megapixels


def grid_of(megapixels: float) -> tuple[int, int, int]:
    """Photos a side, the side of a photo and the step to the next one, px."""
    count = next((count for most, count in GRIDS if megapixels <= most), GRID)
    side = round(np.sqrt(megapixels * 1e6) / ((1 - OVERLAP) * (count - 1) + 1))
    return count, side, round(side * (1 - OVERLAP))


def make_photos(folder: Path, megapixels: float) -> None:
    """Cut the flat picture into photos."""
    count, side, step = grid_of(megapixels)
    texture = cv2.cvtColor(procedural_texture(PERIOD, PERIOD, TEXTURE_SEED), cv2.COLOR_RGB2BGR)
    for row in range(count):
        for column in range(count):
            y, x = (np.arange(first, first + side) % PERIOD for first in (row * step, column * step))
            name = str(folder / f"{row:02d}_{column:02d}.jpg")
            cv2.imwrite(name, texture[np.ix_(y, x)], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def render(folder: Path, megapixels: float, threads: int, kind: str) -> Row:
    """Make the panorama in this process."""
    count, side, step = grid_of(megapixels)
    photos = [open_photo(path) for path in sorted(folder.glob("*.jpg"))]
    places = [(column * step, row * step) for row in range(count) for column in range(count)]
    cameras = [
        Camera((side, side), 1.0, (0.0, 0.0), np.array([[1.0, 0, -x], [0, 1, -y], [0, 0, 1]])) for x, y in places
    ]
    alignment = Alignment("similarity", tuple(photos), tuple(cameras), (), (), 0.0, 0.0)
    limit = LIMIT if megapixels >= BOUNDED_FROM else None
    name, compression = FORMATS[kind]
    options, run = Options.of(compression=compression, max_memory=limit), Executor(threads)
    began = time.process_time()
    panorama = pipeline.render(alignment, options, run=run)
    planned = time.process_time()
    write_panorama(panorama, str(folder / name), options.output, run=run)
    done = time.process_time()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    crop = panorama.plan.crop
    return Row(crop.width, crop.height, len(photos), side, kind, limit or "", planned - began, done - planned, peak)


def measured(folder: Path, megapixels: float, threads: int, kind: str) -> Row:
    """Make the panorama in a process of its own; its file is gone when this returns."""
    words = ["--child", str(folder), "--format", kind, "--threads", str(threads)]
    command = [sys.executable, __file__, "--megapixels", str(megapixels), *words]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    (folder / FORMATS[kind][0]).unlink()
    return Row(**json.loads(done.stdout))


def measure_all(sizes: Sequence[float], threads: int) -> list[Row]:
    """A row for each size and each format that it is written in."""
    rows = []
    for megapixels in sizes:
        with tempfile.TemporaryDirectory(prefix="panostitch-scaling-") as name:
            folder = Path(name)
            # in a process of its own as well: a child may be booked with the memory of the process it comes from
            command = [sys.executable, __file__, "--megapixels", str(megapixels), "--prepare", name]
            subprocess.run(command, check=True)
            large = ("TIFF", "JPEG") if megapixels >= BOUNDED_FROM else ("TIFF",)
            kinds = tuple(FORMATS) if megapixels == MEASURE else large
            rows += [measured(folder, megapixels, threads, kind) for kind in kinds]
            print(*(asdict(row) for row in rows[-len(kinds) :]), sep="\n", file=sys.stderr)
    return rows


def page(rows: Sequence[Row], sizes: str, threads: int) -> str:
    """The table as Markdown."""
    unit = next((row for row in rows if abs(row.megapixels - MEASURE) < 1 and row.format == "TIFF"), rows[0])
    lines = [
        "# How rendering scales",
        "",
        "<!-- made by benchmarks/scaling.py -->",
        "",
        f"`python benchmarks/scaling.py --megapixels {sizes} --output docs/reference/scaling.md`,",
        f"on {threads} threads.",
        "",
        "A flat picture in a grid of JPEG photos that overlap by a quarter, with known places; a process of its own",
        "for each row. CPU time is that of all threads together, for the plan and the tiles; `relative` is it for a",
        f"megapixel, as a multiple of the row of {unit.megapixels:.0f} megapixels. Memory is what the process held at",
        "most, Python and its libraries included.",
        "",
        "| megapixels | picture | photos | file | `--max-memory` | CPU s | relative | plan | memory MB |",
        "|---:|---|---|---|---|---:|---:|---:|---:|",
    ]
    for row in rows:
        seconds = row.plan + row.tiles
        lines.append(
            f"| {row.megapixels:.0f} | {row.width} x {row.height} | {row.photos} of {row.photo_side}² px "
            f"| {row.format} | {row.limit or '-'} | {seconds:.1f} | {row.per_megapixel / unit.per_megapixel:.2f} "
            f"| {row.plan / seconds:.0%} | {row.peak / 2**20:.0f} |"
        )
    lines += [
        "",
        "A small panorama spends most of its time on the plan, above all on the seams, which take much the same time",
        "however small it is.",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, and print the table or write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--megapixels", type=float, nargs="+", default=[1, 4, 16, 64, 256, 1100])
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--output", type=Path)
    parser.add_argument("--prepare", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--format", choices=FORMATS, default="TIFF", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.prepare:
        make_photos(given.prepare, given.megapixels[0])
    elif given.child:
        print(json.dumps(asdict(render(given.child, given.megapixels[0], given.threads, given.format))))
    else:
        text = page(
            measure_all(given.megapixels, given.threads), " ".join(f"{n:g}" for n in given.megapixels), given.threads
        )
        if given.output:
            given.output.write_text(text)
        else:
            print(text)


if __name__ == "__main__":
    main()
