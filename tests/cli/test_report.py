"""What is said of alignments: local warps and weak links."""

from dataclasses import replace

import pytest

from panostitch.cli.report import say_alignment
from panostitch.model.alignment import Alignment, LocalWarp
from panostitch.model.finding import Finding

HELD = "40 matches that were held back are 1.50 px off, 0.30 px with the photos bent"


@pytest.mark.parametrize(
    ("warp", "line"),
    [
        (LocalWarp(True, 40, 1.5, 1.1, 0.3, 0.2), f"local warp: {HELD}\n"),
        (LocalWarp(False, 40, 1.5, 1.1, 0.3, 0.2), f"local warp: none: {HELD}, which is not clearly better\n"),
        (LocalWarp(False, 8, 1.5, 1.1, 0.3, 0.2), "too few to judge by"),
        (LocalWarp(False, 0, 0.0, 0.0, 0.0, 0.0), "local warp: none: no matches"),
    ],
)
def test_the_gain_of_meshes_is_said(capsys, warp, line):
    say_alignment(Alignment("rotation", (), (), (), (), 0.4, 0.9, local_warp=warp), verbose=0)

    assert line in capsys.readouterr().err


def test_weak_links_are_said_with_their_cause_and_what_to_try(capsys):
    weak = Finding("a", "b", "blur", "a is soft", "take a again", weak=True)
    alignment = Alignment("rotation", (), (), (), (), 0.4, 0.9, findings=(weak, replace(weak, photo="c", weak=False)))

    say_alignment(alignment, verbose=0)

    said = capsys.readouterr().err
    assert "weak link: a - b: blur: a is soft\n  next: take a again\n" in said
    assert said.count("weak link") == 1


def test_nothing_is_said_where_nothing_was_tried(capsys):
    say_alignment(Alignment("rotation", (), (), (), (), 0.4, 0.9), verbose=0)

    assert "local warp" not in capsys.readouterr().err
