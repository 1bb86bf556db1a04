"""Where the CPU time of a run goes, stage by stage: `benchmarks/speed.py` runs this in a process of its own.

    python benchmarks/speed_stages.py PHOTOS... OUTPUT

On one thread, so that what is called within a stage is known; a stage within another one counts for itself.
"""

import json
import sys
import time
from collections import Counter
from collections.abc import Callable, MutableMapping
from typing import Any

import cv2

from panostitch import alignment, pipeline, recognition
from panostitch.cli.main import run
from panostitch.compositing import compose, make_plan
from panostitch.compositing.blend import BLENDERS, multiband
from panostitch.compositing.exposure import EXPOSURE
from panostitch.compositing.seams import SEAMS
from panostitch.io import readers, rendering, writers

START = "Python and libraries"
REST = "all else"
_modules: Any = sys.modules
COMPOSE, PLAN = (vars(_modules[function.__module__]) for function in (compose, make_plan))
BLENDER = vars(BLENDERS["multiband"])

# What is said of a stage, where its function is looked up, and its name there
STAGES: list[tuple[str, MutableMapping[str, Any], str]] = [
    ("decoding", vars(readers), "_decode_jpeg"),
    ("key points", vars(recognition), "detect"),
    ("matches", vars(recognition), "link_photos"),
    ("control points on the full photos", vars(alignment), "_control_points"),
    ("cameras", vars(pipeline), "align_group"),
    ("plan: light", EXPOSURE, "auto"),
    ("plan: light", PLAN, "expose_all"),
    ("plan: seams", SEAMS, "graphcut"),
    ("plan: all else", vars(pipeline), "make_plan"),
    ("sampling", COMPOSE, "sample"),
    ("light", COMPOSE, "expose"),
    ("bands at seams", BLENDER, "join"),
    ("change of the low bands", BLENDER, "alone"),
    ("change of the low bands", vars(multiband), "alone"),  # as `join` calls it
    ("plan: low bands", BLENDER, "blend_reduced"),
    ("tiles: all else", vars(rendering), "read_tile"),
    ("putting tiles together", vars(writers), "encode_panorama"),
    ("encoding", vars(cv2), "imencodeWithMetadata"),
]


class Clock:
    """CPU seconds of each stage, less those of the stages within it."""

    def __init__(self) -> None:
        self.spent: Counter[str] = Counter()
        self._within: list[float] = []

    def timed(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, and its time is counted."""

        def measured(*args: Any, **options: Any) -> Any:
            self._within.append(0.0)
            began = time.process_time()
            try:
                return function(*args, **options)
            finally:
                whole = time.process_time() - began
                self.spent[stage] += whole - self._within.pop()
                if self._within:
                    self._within[-1] += whole

        return measured


def main() -> int:
    """Stitch, and print the seconds of all stages as JSON."""
    cv2.setNumThreads(1)
    clock = Clock()
    clock.spent[START] = time.process_time()
    for stage, holder, name in STAGES:
        holder[name] = clock.timed(stage, holder[name])
    *photos, output = sys.argv[1:]
    code = run([*photos, "-o", output, "--crop", "none", "--overwrite", "--quiet", "--threads", "1"])
    clock.spent[REST] = time.process_time() - sum(clock.spent.values())
    print(json.dumps(clock.spent))
    return code


if __name__ == "__main__":
    sys.exit(main())
