"""What the page is made of: by known truth and on small made-up records."""

import numpy as np
import pytest

from panostitch.model.canvas import Canvas, Region
from panostitch.model.score import Score, SeamScore, Worst
from panostitch.options import Options
from panostitch.report import lines
from panostitch.report.facts import BARS, histogram, option_rows, photo_rows
from panostitch.report.graph import WIDTH, graph
from panostitch.report.pairs import HEIGHT, pairs_shown, residual_vectors
from panostitch.report.record import WORST, WORST_SIDE, _about, _cut, worst_places
from panostitch.report.stages import Stages

from .conftest import HOSTILE

PATH_ROUNDING = 0.05  # px; paths have one decimal place
RMS_TOLERANCE = 1e-6  # px; the same points under the same cameras


def numbers(path):
    return [tuple(map(float, point.split())) for point in path.replace("M", "L").split("L")[1:]]


def test_paths_go_through_their_points(rng):
    start, end = rng.uniform(0, 1000, (2, 20, 2))

    points = np.array(numbers(lines.strokes(start, end))).reshape(20, 2, 2)

    assert np.abs(points[:, 0] - start).max() <= PATH_ROUNDING
    assert np.abs(points[:, 1] - end).max() <= PATH_ROUNDING


def test_seams_are_the_borders_between_photos():
    labels = np.array([[0, 0, 1, 1], [0, 0, 1, 1], [2, 2, 2, -1]], np.int16)

    assert lines.seams(labels) == "M2 0v2M0 2h3"
    assert lines.seams(np.zeros((3, 4), np.int16)) == ""


def test_a_crop_goes_on_round_the_back_of_a_turn():
    pixels = np.arange(10)[None].repeat(3, axis=0)

    assert _cut(pixels, Region(7, 1, 6, 2)).tolist() == [[7, 8, 9, 0, 1, 2]] * 2


@pytest.mark.parametrize("at", [(0, 0), (500, 300), (999, 599)])
def test_the_square_about_a_place_lies_in_the_crop(at):
    crop = Region(-3, 5, 1000, 600)
    region = _about(Worst(*map(float, at), 1.0, *[None] * 5), crop)

    assert region & crop == region
    assert (region.width, region.height) == (WORST_SIDE, WORST_SIDE)


def test_the_worst_places_of_all_seams_are_apart_and_in_order():
    def seam(name, faults):
        worst = tuple(Worst(x, 0.0, fault, *[None] * 5) for x, fault in faults)
        return SeamScore("a", name, 1.0, Score(None, None, None, None, None, None, None, 0, 0.0, worst))

    seams = [
        seam("b", [(1000.0 * k, 20.0 - k) for k in range(9)]),
        seam("c", [(10.0, 30.0), (9000.0, 1.0), (1e5, 0.5)]),
    ]
    found = worst_places(seams)

    assert [worst.fault for _, worst in found] == [30.0, *(20.0 - k for k in range(1, 9)), 1.0]
    assert len(found) == WORST


def test_residuals_are_those_that_the_alignment_states(made):
    alignment = made.record.alignment
    off = np.concatenate([residual_vectors(alignment, points) for points in alignment.control_points])

    assert np.sqrt((off**2).sum(1).mean()) == pytest.approx(alignment.rms, abs=RMS_TOLERANCE)
    shown = histogram(alignment)
    assert shown.rms == pytest.approx(alignment.rms, abs=RMS_TOLERANCE)
    assert sum(bar.count for bar in shown.bars) == shown.count == len(off)
    assert len(shown.bars) == BARS
    assert max(bar.share for bar in shown.bars) == 1.0
    assert histogram(None) is None


def test_every_photo_has_a_row(made):
    rows = {row.name: row for row in photo_rows(made.record)}

    assert list(rows) == ["a.jpg", HOSTILE, "c.jpg", "d é.jpg"]
    assert [row.state for row in rows.values()] == ["used", "used", "used", "left out"]
    assert sum(row.share for row in rows.values()) == pytest.approx(1.0)
    assert rows["d é.jpg"].left_out.cause == "different scene"
    assert all(row.key_points > 0 for row in rows.values())


def test_pairs_are_drawn_on_their_sheet(made):
    pairs = pairs_shown(made.record)

    assert [pair.number for pair in pairs] == list(range(1, len(pairs) + 1))
    assert {pair.photos for pair in pairs if pair.kind == "link"} >= {("a.jpg", HOSTILE), (HOSTILE, "c.jpg")}
    for pair in pairs:
        points = np.array(numbers(pair.figure.agree)).reshape(-1, 2, 2)
        assert (points[:, 0, 0] <= pair.figure.left_width).all()
        assert (points[:, 1, 0] >= pair.figure.right).all()
        assert (points[..., 1] <= HEIGHT).all()
        assert pair.figure.residuals.times >= 1


def test_photos_have_their_places_in_the_graph(made):
    drawn = graph(made.record, pairs_shown(made.record))
    nodes = {node.name: node for node in drawn.nodes}

    assert [nodes[name].placed for name in ("a.jpg", HOSTILE, "c.jpg", "d é.jpg")] == [True, True, True, False]
    assert nodes["a.jpg"].x < nodes[HOSTILE].x < nodes["c.jpg"].x
    assert all(0 <= node.x <= WIDTH and 0 <= node.y <= drawn.height for node in drawn.nodes)
    assert nodes["d é.jpg"].y > nodes["a.jpg"].y


def test_a_failed_run_has_its_photos_on_a_circle(failed):
    drawn = graph(failed.record, ())

    assert [node.placed for node in drawn.nodes] == [False, False]
    assert drawn.backdrop is None


def test_a_link_round_the_back_of_a_turn_is_drawn_on_both_edges(made, monkeypatch):
    from panostitch.report import graph as module

    canvas = Canvas("equirectangular", 100.0, (-314.0, -157.0), (628, 314), wraps=True)
    alignment = made.record.alignment
    monkeypatch.setattr(made.record, "laid_out", (alignment, canvas))
    places = iter([np.array([10.0, 100.0]), np.array([300.0, 100.0]), np.array([620.0, 100.0])])
    monkeypatch.setattr(module.lines, "outline", lambda *_: ("M0 0", next(places)))

    drawn = graph(made.record, pairs_shown(made.record))

    paths = {edge.pair.photos: edge.path.count("M") for edge in drawn.edges}
    assert paths["a.jpg", HOSTILE] == 1
    assert paths.get(("a.jpg", "c.jpg"), 2) == 2


def test_only_what_differs_from_the_default_is_changed():
    rows = option_rows(Options.of(ratio=0.5))

    assert [(row.name, row.value, row.default) for row in rows if row.changed] == [("--ratio", 0.5, 0.8)]


def test_time_goes_to_the_stage_that_tells_of_it():
    clock = iter([0.0, 1.0, 10.0, 12.0, 20.0, 23.0, 30.0])
    resident = iter([5, 9, 7])
    stages = Stages(lambda: next(clock), lambda: next(resident))

    for name in ("features", "matching", "features"):
        with stages.told(name):
            pass

    # what passes while an event is taken, 1 to 10 and 12 to 20, is nobody's
    assert [(stage.name, stage.seconds, stage.resident) for stage in stages] == [
        ("features", 4.0, 7),
        ("matching", 2.0, 9),
    ]
    assert (stages.seconds, stages.resident) == (6.0, 9)
