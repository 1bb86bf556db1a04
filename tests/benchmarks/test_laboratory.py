"""The laboratory: every experiment at a tiny size, what it measures with, and its pages."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
HOME = ROOT / "benchmarks" / "laboratory"
DOCS = ROOT / "docs" / "explanation" / "laboratory"
NAMES = (
    "ratio-test", "ransac", "matchers", "distances", "surf-sift", "orb-speed", "corners", "repeated-patterns",
    "parallax",
)  # fmt: skip
LARGEST = 60_000  # bytes of a plot or picture
VERDICTS = {"holds", "holds in part", "does not hold"}


@pytest.fixture(scope="module", autouse=True)
def laboratory():
    """Its modules can be imported, and are gone afterwards."""
    before = set(sys.modules)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(HOME))
        patch.setenv("OPENBLAS_NUM_THREADS", "1")
        yield importlib.import_module("run")
    for name in set(sys.modules) - before:
        if str(HOME) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


@pytest.fixture(scope="module")
def module():
    return lambda name: sys.modules[name]


def test_every_experiment_is_tested(laboratory):
    assert tuple(laboratory.EXPERIMENTS) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_experiment(name, laboratory, module):
    experiment = laboratory.EXPERIMENTS[name]
    report = experiment.experiment(experiment.TINY)
    text = module("report").page(name, report, "this and that")
    assert report.findings
    assert {finding.verdict for finding in report.findings} <= VERDICTS
    assert text.startswith(f"# {experiment.TITLE}\n")
    assert experiment.CLAIM.text in text
    assert module("report").verdict_on(text) == report.verdict
    for plot in report.plots:
        assert all(len(series.x) == len(series.y) > 0 for series in plot.series)
        assert f"({plot.name}.svg)" in text
    for table in report.tables:
        assert all(len(row) == len(table.head) for row in table.rows)


def test_pages_are_those_of_the_experiments(laboratory):
    for name, experiment in laboratory.EXPERIMENTS.items():
        text = (DOCS / f"{name}.md").read_text()
        assert text.startswith(f"# {experiment.TITLE}\n")
        assert experiment.CLAIM.text in text
        assert experiment.METHOD in text
    assert (DOCS / "README.md").read_text() == laboratory.front_page(DOCS)


def test_plots_are_small_and_belong_to_a_page():
    pages = "".join(path.read_text() for path in DOCS.glob("*.md"))
    for path in DOCS.iterdir():
        assert path.stat().st_size < LARGEST, path.name
        assert path.suffix == ".md" or f"({path.name})" in pages, path.name


def test_same_numbers_give_the_same_plot(laboratory, module, tmp_path):
    report = module("report")
    plot = report.Plot("p", "t", "x", "y", (report.Series("a & b", [1, 10], [2, 3]),), log_x=True)
    written = []
    for n in range(2):
        laboratory.write("p", report.Report("T", report.Claim("c", "s"), "m", (), plots=(plot,)), tmp_path / str(n))
        written.append((tmp_path / str(n) / "p.svg").read_bytes())
    assert written[0] == written[1]
    assert b"a &amp; b" in written[0]


def test_samples_that_theory_asks_for(module):
    """Fischler & Bolles' formula by hand, of the textbook's table and of the program's confidence."""
    assert module("ransac").promised(0.5) == pytest.approx(71.4, abs=0.1)  # Hartley & Zisserman, table 4.3: 72
    assert module("ransac").promised(0.5, 0.5) == pytest.approx(np.log(0.5) / np.log(15 / 16))


def test_models_of_minimal_samples_are_exact(module, rng):
    ransac = module("ransac")
    given = ransac.problem(outliers=0.25, noise=0.0, seed=1)
    true = np.flatnonzero(given.true)
    chosen = np.array([rng.choice(true, 4, replace=False) for _ in range(20)])
    assert ransac.is_found(ransac.models(given.src[chosen], given.dst[chosen]), given).all()
    false = np.flatnonzero(~given.true)[:4]
    assert not ransac.is_found(ransac.models(given.src[None, false], given.dst[None, false]), given).any()


def test_repeatability_of_known_points(module, rng):
    """Of points sent by the true cameras all are found again, and none if all are moved by more than allowed."""
    scenes = module("scenes")
    views = [
        scenes.View(np.zeros((150, 200), np.uint8), camera)
        for camera in scenes.rig([0.0, 0.1], 0.0, [0.0, 0.3], size=(200, 150), hfov=scenes.HFOV)
    ]
    xy = rng.uniform((0, 0), (199, 149), (50, 2))
    there = scenes.truly(*views, xy)
    seen = np.isfinite(there).all(1)
    assert 0 < seen.sum() < len(xy)
    assert scenes.repeatability(*views, xy, there[seen], 1e-6) == 1
    assert scenes.repeatability(*views, xy, there[seen][::2], 1e-6) == np.ceil(seen.sum() / 2) / seen.sum()
    assert scenes.repeatability(*views, xy, there[seen] + 1000, 2.0) == 0
    assert scenes.repeatability(*views, xy, np.zeros((0, 2)), 2.0) == 0


def test_ratio_test_is_counted_by_hand(module):
    ratio_test = module("ratio_test")
    best, second = np.array([1.0, 1.0, 1.0, 1.0], np.float32), np.array([2.0, 1.1, 2.0, 1.1], np.float32)
    neighbours = ratio_test.Neighbours(np.arange(4, dtype=np.int32), best, second, np.array([True, True, False, True]))
    judged = ratio_test.Judged(neighbours, np.array([True, True, False, False]))
    assert judged.removed(0.8) == (0.5, 0.5)  # wrong: the fourth of two; right: the second of two
    assert judged.not_mutual() == (0.5, 0.0)
    assert judged.removed_by_both(0.8) == (1.0, 0.5)


def test_parallax_is_what_the_formula_says(module):
    """Of two walls the robust homography keeps one; the other is off by the formula."""
    camera = module("moved_camera")
    found = camera.errors(camera.two_walls, 0.05, 2.0, 200)
    assert found.robust * np.sqrt(2) == pytest.approx(camera.told(0.05, 2.0), rel=0.1)
    assert found.least_squares < found.robust
    assert camera.errors(camera.slanted, 0.05, 2.0, 200).least_squares < camera.EXACT


def test_facade_repeats_itself(module, rng):
    patterns = module("repeated_patterns")
    side, period = 60, 3
    wall = patterns.facade(period, side, rng).astype(float)
    again = np.abs(wall[:, : -period * side] - wall[:, period * side :]).mean()
    shifted = np.abs(wall[:, :-side] - wall[:, side:]).mean()
    assert again < patterns.GRAIN < shifted
