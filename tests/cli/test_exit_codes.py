"""Exit codes and what is said with them: one line that names the file and the reason, then what to do."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from panostitch.io.limits import SIDES

OK, BUG, USAGE, LEFT_OUT, NO_OVERLAP, UNREADABLE, LIMIT, UNWRITABLE, INTERRUPTED = 0, 1, 2, 3, 4, 5, 7, 8, 130

# Where the defaults are not the point: a third of the time.
QUICK = ["--detector", "orb", "--max-features", "600", "--retries", "none", "--seams", "voronoi", "--blender", "none"]

# px; three photos of 400 x 300, 84 degrees wide together: 770 px and a little less height, and the crop may take a bit
WIDTHS, HEIGHTS = (650, 850), (230, 320)

# What a progress bar leaves in a file: a return to the start of the line, percentages, blocks.
BAR = re.compile(r"\r|\d+%\||[█▏▎▍▌▋▊▉]|\x1b")


@pytest.fixture
def inputs(photos):
    return [photos / "a.jpg", photos / "b.jpg", photos / "c.jpg"]


def failed(result, code, *words):
    """The run ended with this code, said so in one line, and wrote no JSON and no file."""
    assert result.code == code, result.err
    assert result.out == ""
    lines = result.err.splitlines()
    (at,) = (n for n, line in enumerate(lines) if line.startswith("error: "))
    for word in words:
        assert word in lines[at]
    assert all(line.startswith("  ") for line in lines[at + 1 :])
    assert left_behind() == []


def failed_beside(result, code, *words, beside=("out.jpg",)):
    """As `failed`, where earlier runs have left files."""
    (line,) = [line for line in result.err.splitlines() if line.startswith("error: ")]
    assert result.code == code, result.err
    assert all(word in line for word in words)
    assert left_behind() == list(beside)


def misused(result, *words):
    """The run was refused by the parser of options."""
    assert result.code == USAGE
    assert result.out == ""
    assert "Error: " in result.err
    for word in words:
        assert word in result.err
    assert left_behind() == []


def left_behind():
    return sorted(entry for entry in os.listdir() if not entry.startswith("given"))


def panorama(path):
    with Image.open(path) as image:
        assert WIDTHS[0] <= image.size[0] <= WIDTHS[1]
        assert HEIGHTS[0] <= image.size[1] <= HEIGHTS[1]
        return np.asarray(image)


def test_all_photos_in(call, inputs):
    result = call(*inputs, "-o", "out.jpg")

    assert result.code == OK
    assert result.out == ""
    assert "aligned 3 of 3 photos" in result.err
    assert "out.jpg: " in result.err
    assert left_behind() == ["out.jpg"]
    panorama("out.jpg")


def test_the_word_stitch_may_be_said(call, inputs):
    assert call("stitch", *inputs, "-o", "out.png", *QUICK).code == OK
    panorama("out.png")


def test_a_file_that_is_missing(call, inputs):
    failed(call(*inputs, "nowhere.jpg", "-o", "out.jpg"), UNREADABLE, "nowhere.jpg", "no such file")


def test_all_files_that_are_missing_are_named(call, inputs):
    result = call(*inputs, "one.jpg", "two.jpg", "three.jpg", "-o", "out.jpg")

    failed(result, UNREADABLE, "one.jpg", "2 more")
    assert "two.jpg" in result.err
    assert "three.jpg" in result.err


@pytest.mark.parametrize("name", ["letter.jpg", "empty.jpg"])
def test_a_file_that_is_no_picture_is_left_out_by_name(name, call, inputs, strays):
    result = call(*inputs, strays / name, "-o", "out.jpg", *QUICK)

    assert result.code == LEFT_OUT
    assert f"left out: {name}: not a picture" in result.err
    panorama("out.jpg")
    failed_beside(call(*inputs, strays / name, "-o", "2.jpg", "--require-all"), UNREADABLE, name, "not a picture")


def test_one_photo_alone(call, inputs):
    failed(call(inputs[0], "-o", "out.jpg"), UNREADABLE, "a.jpg", "only photo")


def test_one_photo_twice(call, inputs):
    failed(call(inputs[0], inputs[0], "-o", "out.jpg"), UNREADABLE, "a.jpg", "only photo")


def test_a_folder_without_photos(call, tmp_path):
    (tmp_path / "given").mkdir()
    result = call("given", "-o", "out.jpg")

    failed(result, USAGE, "no photos in given")
    assert "next: photos in a folder end in .bmp, " in result.err


def test_a_folder_of_folders_is_for_batch(call, inputs, tmp_path):
    (tmp_path / "given" / "below").mkdir(parents=True)
    shutil.copy(inputs[0], tmp_path / "given" / "below")
    result = call("given", "-o", "out.jpg")

    failed(result, USAGE, "no photos in given")
    assert "panostitch batch" in result.err


def test_a_folder_of_what_phones_write(call, tmp_path):
    (tmp_path / "given").mkdir()
    for name in ("1.HEIC", "2.HEIC", "notes.txt"):
        (tmp_path / "given" / name).touch()
    result = call("given", "-o", "out.jpg")

    failed(result, USAGE, "no photos in given")
    assert "next: 2 files end in .HEIC, which is not read: save them as JPEG" in result.err


def test_no_overlap(call, inputs, strays):
    result = call(inputs[0], strays / "lonely.jpg", "-o", "out.jpg", *QUICK)

    failed(result, NO_OVERLAP, "no two photos overlap")
    assert "a.jpg: " in result.err
    assert "lonely.jpg: " in result.err
    assert "  next: " in result.err


def test_a_photo_that_does_not_belong_is_left_out_by_name(call, inputs, strays):
    result = call(*inputs, strays / "lonely.jpg", "-o", "out.jpg", *QUICK)

    assert result.code == LEFT_OUT
    assert "aligned 3 of 4 photos" in result.err
    assert "left out: lonely.jpg: overlaps no other photo" in result.err
    panorama("out.jpg")


@pytest.mark.parametrize("name", ["half.jpg", "half.png"])
def test_half_a_photo_is_left_out_by_name(name, call, inputs, strays):
    result = call(*inputs, strays / name, "-o", "out.jpg", *QUICK)

    assert result.code == LEFT_OUT
    assert f"left out: {name}: " in result.err
    assert "broken" in result.err
    panorama("out.jpg")


def test_all_photos_may_be_required(call, inputs, strays):
    lonely, half = strays / "lonely.jpg", strays / "half.jpg"

    failed(call(*inputs, lonely, "-o", "out.jpg", "--require-all", *QUICK), NO_OVERLAP, "lonely.jpg")
    failed(call(*inputs, lonely, half, "-o", "out.jpg", "--require-all", *QUICK), UNREADABLE, "half.jpg")
    assert call(*inputs, "-o", "out.jpg", "--require-all", *QUICK).code == OK


def test_photos_may_be_allowed_to_be_left_out(call, inputs, strays):
    result = call(*inputs, strays / "lonely.jpg", "-o", "out.jpg", "--allow-partial", "--json", *QUICK)

    assert result.code == json.loads(result.out)["exit_code"] == OK
    assert "left out: lonely.jpg" in result.err


def test_all_required_and_some_allowed_to_be_missing(call, inputs):
    failed(
        call(*inputs, "-o", "out.jpg", "--require-all", "--allow-partial"), USAGE, "--require-all", "--allow-partial"
    )


def test_photos_can_be_excluded(call, inputs, strays):
    names = ["--exclude", "lonely.jpg", "--exclude", strays / "letter.jpg"]

    result = call(*inputs, strays / "lonely.jpg", strays / "letter.jpg", "-o", "out.jpg", *names, *QUICK)

    assert result.code == OK, result.err
    assert "photos: 3 of 3 used" in result.err


def test_a_name_to_exclude_that_no_photo_has(call, inputs):
    result = call(*inputs, "-o", "out.jpg", "--exclude", "aa.jpg")

    failed(result, USAGE, "--exclude aa.jpg", "no photo has that name")
    assert "  next: the nearest is a.jpg" in result.err


def test_all_photos_excluded(call, inputs):
    names = [word for path in inputs for word in ("--exclude", path.name)]

    failed(call(*inputs, "-o", "out.jpg", *names), USAGE, "--exclude leaves no photo")
    failed(call(*inputs, "-o", "out.jpg", *names[2:]), UNREADABLE, "a.jpg is the only photo")


def test_what_became_of_every_photo_is_said_and_in_the_json(call, inputs, strays):
    arguments = [*inputs, strays / "lonely.jpg", strays / "half.jpg", "-o", "out.jpg", *QUICK]

    result = call(*arguments, "--json")

    assert "photos: 3 of 5 used, 1 unreadable, 1 left out" in result.err
    rows = [line for line in result.err.splitlines() if line.startswith(("lonely.jpg ", "half.jpg ", "a.jpg "))]
    assert [line.split()[0] for line in rows] == ["half.jpg", "lonely.jpg"]
    data = json.loads(result.out)
    states = {row["name"]: row["state"] for row in data["inclusion"]}
    assert states == dict.fromkeys(["a.jpg", "b.jpg", "c.jpg"], "used") | {
        "half.jpg": "unreadable",
        "lonely.jpg": "left out",
    }
    assert sum(row["share"] for row in data["inclusion"]) == pytest.approx(1)
    (finding,) = data["findings"]
    assert (finding["photo"], finding["cause"]) == ("lonely.jpg", "different scene")
    assert data["advice"] == []


def test_where_all_is_well_one_line_says_so(call, inputs):
    result = call(*inputs, "-o", "out.jpg", *QUICK)

    assert [line for line in result.err.splitlines() if "photos: " in line] == ["photos: 3 of 3 used"]
    assert "advice: " not in result.err
    verbose = call("-v", *inputs, "-o", "2.jpg", *QUICK)
    assert len([line for line in verbose.err.splitlines() if " used " in line and "%" in line]) == 3


def test_nothing_but_broken_photos_is_not_a_lack_of_overlap(call, inputs, strays):
    failed(call(inputs[0], strays / "half.jpg", "-o", "out.jpg"), UNREADABLE, "half.jpg")


def test_the_output_exists(call, inputs, tmp_path):
    (tmp_path / "given.jpg").write_bytes(b"precious")

    failed(call(*inputs, "-o", "given.jpg"), UNWRITABLE, "given.jpg", "exists already")

    assert (tmp_path / "given.jpg").read_bytes() == b"precious"
    assert call(*inputs, "-o", "given.jpg", "--overwrite", *QUICK).code == OK
    panorama("given.jpg")


def test_the_folder_of_the_output_is_missing(call, inputs):
    failed(call(*inputs, "-o", "none/out.jpg"), UNWRITABLE, "none/out.jpg", "no folder none")


@pytest.mark.parametrize("more", [[], ["--overwrite"]])
def test_the_output_is_one_of_the_photos(more, call, inputs, tmp_path):
    shutil.copy(inputs[0], tmp_path / "given.jpg")
    before = (tmp_path / "given.jpg").read_bytes()

    failed(call("given.jpg", *inputs[1:], "-o", "./given.jpg", *more), UNWRITABLE, "given.jpg", "one of the photos")

    assert (tmp_path / "given.jpg").read_bytes() == before


@pytest.mark.parametrize("name", ["out.gif", "out", ".jpg", "out.jpg.bak"])
def test_the_output_has_an_unknown_extension(name, call, inputs):
    failed(call(*inputs, "-o", name), UNWRITABLE, name, ".png")


def test_the_name_of_the_output_is_too_long(call, inputs):
    failed(call(*inputs, "-o", "a" * 300 + ".jpg"), UNWRITABLE, "aaa")


MISUSE = {
    "unknown choice": (["--detector", "harris"], ["--detector", "harris", "sift", "surf", "orb", "akaze"]),
    "unknown option": (["--detctor", "sift"], ["--detctor", "--detector"]),
    "above the range": (["--ratio", "7"], ["--ratio", "0.1<=x<=1.0"]),
    "below the range": (["--max-features", "0"], ["--max-features", "50"]),
    "no number": (["--scale", "large"], ["--scale", "large"]),
    "not a number": (["--ratio", "nan"], ["--ratio"]),
    "no integer": (["--threads", "1.5"], ["--threads", "1.5"]),
    "value missing": (["--blender"], ["--blender"]),
}


@pytest.mark.parametrize("case", MISUSE)
def test_an_option_makes_no_sense(case, call, inputs):
    arguments, words = MISUSE[case]

    misused(call(*inputs, "-o", "out.jpg", *arguments), *words)


def test_arguments_are_missing(call, inputs):
    misused(call(*inputs), "--output")
    misused(call("-o", "out.jpg"), "PHOTOS")
    assert call().code == USAGE


def test_a_projection_that_cannot_show_the_view(call, inputs):
    # a flat subject has no longitude
    failed(
        call(*inputs[:2], "-o", "out.jpg", "--model", "homography", "--projection", "cylindrical", *QUICK),
        USAGE,
        "--projection cylindrical",
    )


# Ways to name the three photos; `given*` stand in the folder in which the command runs.
NAMED = {
    "a folder": ["given"],
    "a folder with a slash": ["given/"],
    "a glob": ["given/?.jpg"],
    "a glob of folders": ["giv*"],
    "a list": ["@given/list.txt"],
    "standard input": ["-"],
    "several ways at once": ["given/a.jpg", "@given/list.txt", "given"],
}


@pytest.mark.parametrize("way", NAMED)
def test_ways_to_name_photos(way, call, inputs, tmp_path):
    folder = tmp_path / "given"
    folder.mkdir()
    for path in inputs:
        shutil.copy(path, folder)
    (folder / "notes.txt").write_text("no photo")
    (folder / ".hidden.jpg").write_text("no photo")
    (folder / "list.txt").write_text("a.jpg\n\n  b.jpg  \r\nc.jpg")

    result = call(*NAMED[way], "-o", "out.jpg", "--json", *QUICK, stdin="given/a.jpg\ngiven/b.jpg\n\ngiven/c.jpg\n")

    assert result.code == OK, result.err
    assert [photo["name"] for photo in json.loads(result.out)["photos"]] == ["a.jpg", "b.jpg", "c.jpg"]


def test_names_that_look_like_patterns(call, inputs, tmp_path):
    names = ["given [1].jpg", "given @2.jpg", "@given.jpg"]
    for path, name in zip(inputs, names, strict=True):
        shutil.copy(path, tmp_path / name)

    result = call(*names, "-o", "out.jpg", *QUICK)
    os.unlink("@given.jpg")

    assert result.code == OK, result.err


NAMES = ["given ü😀.jpg", "given 1²2.jpg", os.fsdecode(b"given \xe9.jpg"), "given\n.jpg"]
NAME_BUGS = {NAMES[1]: "bug (1): int('²')", NAMES[2]: "bug (1): the project file is written as strict UTF-8"}


@pytest.mark.parametrize("name", NAMES)
def test_names_of_every_kind(name, call, inputs, tmp_path):
    shutil.copy(inputs[0], tmp_path / name)

    result = call(name, inputs[1], "-o", "out.jpg", "--save-project", "out.pano.json", *QUICK)

    assert result.code == OK, result.err
    assert call("render", "out.pano.json", "-o", "again.jpg", *QUICK[6:]).code == OK


def test_names_without_numbers_beside_names_with_them(call, inputs, tmp_path):
    for path, name in zip(inputs, ["given", "given1", "given1a"], strict=True):
        shutil.copy(path, tmp_path / name)

    assert call("given", "given1", "given1a", "-o", "out.jpg", *QUICK).code == OK


def test_patterns_and_lists_that_name_nothing(call, tmp_path):
    failed(call("given*.jpg", "-o", "out.jpg"), UNREADABLE, "given*.jpg")
    failed(call("@given.txt", "-o", "out.jpg"), UNREADABLE, "given.txt")
    failed(call("-", "-o", "out.jpg"), USAGE, "no photos")
    (tmp_path / "given.txt").write_bytes(b"\xff\xfe\x00")
    failed(call("@given.txt", "-o", "out.jpg"), UNREADABLE, "given.txt")


def test_a_list_as_windows_writes_it(call, inputs, tmp_path):
    text = "\r\n".join(str(path) for path in inputs)
    (tmp_path / "given.txt").write_bytes(b"\xef\xbb\xbf" + text.encode())

    assert call("@given.txt", "-o", "out.jpg", *QUICK).code == OK


def test_quiet_is_silent(call, inputs, strays):
    result = call("-q", *inputs, strays / "lonely.jpg", "-o", "out.jpg", *QUICK)

    assert (result.code, result.out, result.err) == (LEFT_OUT, "", "")


def test_quiet_still_says_what_failed(call, inputs):
    failed(call("--quiet", inputs[0], "-o", "out.jpg"), UNREADABLE, "only photo")


def test_json_stands_alone_on_standard_output(call, inputs, strays):
    result = call(*inputs, strays / "lonely.jpg", "-o", "out.jpg", "--json", *QUICK)

    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    data = json.loads(result.out, parse_constant=refuse)
    assert result.out.startswith("{")
    assert data["exit_code"] == result.code == LEFT_OUT
    assert [photo["name"] for photo in data["photos"]] == ["a.jpg", "b.jpg", "c.jpg"]
    assert [photo["name"] for photo in data["left_out"]] == ["lonely.jpg"]
    assert data["panorama"]["path"] == "out.jpg"
    assert tuple(data["panorama"]["size"]) == panorama("out.jpg").shape[1::-1]


def test_verbose_names_every_photo_and_link(call, inputs):
    result = call("-v", *inputs, "-o", "out.jpg", *QUICK)

    for words in ("a.jpg: focal length", "c.jpg: focal length", "a.jpg - b.jpg: ", "b.jpg - c.jpg: "):
        assert words in result.err


def test_control_characters_of_a_name_do_not_reach_the_terminal(call, inputs):
    result = call(inputs[0], "no\x1b[2J\r\nwhere.jpg", "-o", "out.jpg")

    failed(result, UNREADABLE, "where.jpg")
    assert "\x1b" not in result.err
    assert "\r" not in result.err


def test_half_and_half(call, inputs):
    features, compositing = QUICK[:6], QUICK[6:]
    assert call(*inputs, "-o", "out.jpg", "--save-project", "one.pano.json", *QUICK).code == OK
    first = call("align", *inputs, "-o", "two.pano.json", *features)
    assert (first.code, first.out) == (OK, "")
    second = call("render", "two.pano.json", "-o", "again.jpg", *compositing)
    assert (second.code, second.out) == (OK, "")

    assert Path("one.pano.json").read_bytes() == Path("two.pano.json").read_bytes()
    assert Path("out.jpg").read_bytes() == Path("again.jpg").read_bytes()


def test_the_project_exists(call, inputs, tmp_path):
    (tmp_path / "given.pano.json").write_text("precious")

    failed(call("align", *inputs, "-o", "given.pano.json"), UNWRITABLE, "exists already")
    failed(call(*inputs, "-o", "out.jpg", "--save-project", "given.pano.json"), UNWRITABLE, "exists already")
    failed(call("align", *inputs, "-o", "out.jpg"), UNWRITABLE, ".pano.json")

    assert (tmp_path / "given.pano.json").read_text() == "precious"


def test_a_project_that_is_none(call, strays):
    failed(call("render", "none.pano.json", "-o", "out.jpg"), UNREADABLE, "none.pano.json", "no such file")
    failed(call("render", strays / "letter.jpg", "-o", "out.jpg"), UNREADABLE, "letter.jpg", "not a project file")


def test_the_same_photos_make_the_same_bytes(call, inputs):
    assert call(*inputs, "-o", "1.png", "--threads", 3).code == OK
    assert call(*inputs[::-1], "-o", "2.png", "--threads", 1).code == OK

    assert Path("1.png").read_bytes() == Path("2.png").read_bytes()


def test_a_panorama_too_large_for_its_format(call, inputs, monkeypatch):
    monkeypatch.setitem(SIDES, ".jpg", 500)

    result = call(*inputs, "-o", "out.jpg", *QUICK)

    assert result.code == LIMIT
    assert "error: out.jpg: a JPEG has at most 500 px a side" in result.err
    assert left_behind() == []


def test_a_disk_that_is_full(call, inputs, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", fail)

    result = call(*inputs[:2], "-o", "out.jpg", *QUICK)

    assert result.code == UNWRITABLE
    assert "error: out.jpg: cannot be written: No space left on device" in result.err
    assert left_behind() == []


def test_an_interruption(call, inputs, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("panostitch.pipeline.render", interrupt)

    result = call(*inputs[:2], "-o", "out.jpg", *QUICK)

    assert result.code == INTERRUPTED
    assert result.err.splitlines()[-1].startswith("interrupted")
    assert left_behind() == []


def test_a_bug_says_where_its_story_is(call, inputs, monkeypatch, tmp_path):
    def stumble(*_, **__):
        raise ZeroDivisionError("deep inside")

    monkeypatch.setattr("panostitch.pipeline.align", stumble)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    result = call(*inputs, "-o", "out.jpg")

    assert result.code == BUG
    assert "error: this is a bug in panostitch" in result.err
    assert "deep inside" not in result.err
    (log,) = left_behind()
    assert log in result.err
    assert "ZeroDivisionError: deep inside" in (tmp_path / log).read_text()


def test_as_a_program_of_its_own(inputs, strays, tmp_path):
    arguments = [*inputs, strays / "lonely.jpg", strays / "half.jpg", "-o", "out.jpg", *QUICK]

    done = subprocess.run(
        [sys.executable, "-m", "panostitch", *map(str, arguments)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == LEFT_OUT
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    assert not BAR.search(done.stderr)
    panorama(tmp_path / "out.jpg")
    assert os.listdir(tmp_path) == ["out.jpg"]


def test_an_interrupted_run_does_not_wait_for_its_threads():
    lines = (
        "import threading, time",
        "threading.Thread(target=time.sleep, args=(600,)).start()",
        "from panostitch.cli import main",
        "main.run = lambda arguments: 130",
        "main.main()",
    )

    ended = subprocess.run([sys.executable, "-c", "\n".join(lines)], timeout=60, check=False)

    assert ended.returncode == 130


def test_no_file_that_was_named_is_ever_overwritten(call, photos, strays, tmp_path):
    """Not one that cannot be read, nor one that was excluded."""
    broken, excluded = tmp_path / "half.jpg", tmp_path / "c.jpg"
    broken.write_bytes((strays / "half.jpg").read_bytes())
    excluded.write_bytes((photos / "c.jpg").read_bytes())
    before = broken.read_bytes(), excluded.read_bytes()
    inputs = [photos / "a.jpg", photos / "b.jpg", broken, excluded, "--exclude", "c.jpg", "--overwrite"]

    codes = [call("stitch", *inputs, "-o", path).code for path in (broken, excluded)]

    assert codes == [8, 8]
    assert (broken.read_bytes(), excluded.read_bytes()) == before
