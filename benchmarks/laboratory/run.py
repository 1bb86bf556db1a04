"""The laboratory: measures what textbooks claim, and writes a page with plots for each experiment.

    python benchmarks/laboratory/run.py                 all of them
    python benchmarks/laboratory/run.py --only NAME     one of them; may be repeated

Times are ratios, taken of processor time on one thread. An experiment is a module with TITLE, CLAIM, `experiment()`
and, for its test, settings TINY; it is entered in EXPERIMENTS.
"""

import argparse
import os
import platform
from collections.abc import Sequence
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # read when NumPy is loaded

import cv2
import numpy as np
from PIL import Image

import corners
import distances
import matchers
import moved_camera
import orb_speed
import ransac
import ratio_test
import repeated_patterns
import surf_sift
from report import Report, index, page, verdict_on

DOCS = Path(__file__).parents[2] / "docs" / "explanation" / "laboratory"
FRONT = "README.md"
QUALITY = 80  # of pictures
EXPERIMENTS = {
    "ratio-test": ratio_test,
    "ransac": ransac,
    "matchers": matchers,
    "distances": distances,
    "surf-sift": surf_sift,
    "orb-speed": orb_speed,
    "corners": corners,
    "repeated-patterns": repeated_patterns,
    "parallax": moved_camera,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the experiments that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--only", action="append", choices=list(EXPERIMENTS), metavar="NAME", help="; ".join(EXPERIMENTS)
    )
    parser.add_argument("--docs", type=Path, default=DOCS, help="folder for the pages")
    given = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    for name in given.only or EXPERIMENTS:
        report = EXPERIMENTS[name].experiment()
        write(name, report, given.docs)
        print(f"{name}: {report.verdict}", flush=True)
        for finding in report.findings:
            print(f"  {finding.verdict}: {finding.text}", flush=True)
    (given.docs / FRONT).write_text(front_page(given.docs))


def write(name: str, report: Report, folder: Path) -> None:
    """The page of an experiment with its plots and pictures."""
    import plots

    folder.mkdir(parents=True, exist_ok=True)
    for plot in report.plots:
        plots.draw(plot, folder / f"{plot.name}.svg")
    for file, (_, pixels) in report.pictures.items():
        Image.fromarray(pixels).save(folder / f"{file}.jpg", quality=QUALITY)
    versions = f"OpenCV {cv2.__version__}, NumPy {np.__version__}, Python {platform.python_version()}"
    (folder / f"{name}.md").write_text(page(name, report, versions))


def front_page(folder: Path) -> str:
    """The list of all experiments that have a page in the folder, with the verdicts of these pages."""
    pages = {name: folder / f"{name}.md" for name in EXPERIMENTS}
    return index(
        [
            (name, EXPERIMENTS[name].TITLE, EXPERIMENTS[name].CLAIM, verdict_on(path.read_text()))
            for name, path in pages.items()
            if path.exists()
        ]
    )


if __name__ == "__main__":
    main()
