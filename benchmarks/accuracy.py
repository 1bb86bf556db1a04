"""True error of the four detectors on photographs of known scenes.

    python benchmarks/accuracy.py [--output docs/reference/accuracy.md] [--plans pair,row]

Each plan of cameras is photographed twice: clean, and with exposure steps, vignetting and noise. The error is the
distance between where a point of one photo is in another one and where the estimated cameras say it is.
"""

import argparse
import platform
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from panostitch.features import DETECTORS
from panostitch.jobs import selftest
from panostitch.options import Options
from panostitch.runtime.executor import Executor

# enough to tell detectors apart; the error in all plans, beside that of other programs: benchmarks/ground_truth.py
PLANS = ("row", "rolled", "low_overlap", "barrel", "plane_pair")
CLEAN = selftest.Conditions(exposure_step=0.0, vignetting=0.0, noise=0.0)


def main() -> None:
    """Print the tables, and write them if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, help="Markdown file to write")
    parser.add_argument("--plans", default=",".join(PLANS), help="names of plans, with commas between")
    given = parser.parse_args()
    plans = given.plans.split(",")
    text = "\n".join([HEAD, *_section("Clean photos", plans, CLEAN), *_section(NOISY, plans, selftest.CONDITIONS)])
    print(text)
    if given.output:
        given.output.write_text(text + "\n")


NOISY = (
    f"Exposure steps of {2 * selftest.CONDITIONS.exposure_step:g} EV, {selftest.CONDITIONS.vignetting:.0%} of the "
    f"light lost in the corners, noise of {selftest.CONDITIONS.noise:g} grey levels"
)
HEAD = f"""# Accuracy

True error in pixels (rms) of the alignment of 1200 x 900 photos of a computed scene, for each detector; in brackets the
photos included where some are missing. Made by `python benchmarks/accuracy.py` (`make bench`) with OpenCV
{cv2.__version__}, NumPy {np.__version__}, Python {platform.python_version()}; the photos and hence the figures are the
same on every run."""


def _section(title: str, plans: list[str], conditions: "selftest.Conditions") -> list[str]:
    lines = ["", f"## {title}", "", f"| plan | {' | '.join(DETECTORS)} |", "|---" * (len(DETECTORS) + 1) + "|"]
    scenes = {plan: selftest.photograph(plan, conditions) for plan in plans}
    for plan in plans:
        cells = []
        for detector in DETECTORS:
            options = Options()
            options = replace(options, features=replace(options.features, detector=detector))
            finding = selftest.judge(plan, *scenes[plan], options, Executor(threads=2))
            missing = f" ({finding.photos} of {finding.given})" if finding.photos < finding.given else ""
            cells.append(f"{finding.rms:.3f}{missing}")
        lines.append(f"| {plan} | {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    return lines


if __name__ == "__main__":
    main()
