"""The folder of a dump loses nothing that a dump has not made."""

import json
from pathlib import Path

import pytest

from panostitch.debug import Dump
from panostitch.debug.filenames import LONGEST_BYTES, FileNames, clean
from panostitch.debug.folder import Folder
from panostitch.errors import OutputError


def test_a_folder_with_something_in_it_is_refused(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="not empty") as caught:
        Dump(tmp_path)
    assert caught.value.hint == "choose an empty folder or add --overwrite"
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_overwrite_removes_the_earlier_dump_and_nothing_else(run, tmp_path):
    with Dump(tmp_path) as dump:
        run.send_render(dump)
    mine = [tmp_path / "mine.jpg", tmp_path / "05_warped" / "mine.jpg", tmp_path / "20_mine" / "a.jpg"]
    mine[2].parent.mkdir()
    for path in mine:
        path.write_text("mine")
    with Dump(tmp_path, overwrite=True):
        pass
    left = {path for path in tmp_path.rglob("*") if path.is_file()}
    assert left == {*mine, tmp_path / "metrics.json"}
    assert not (tmp_path / "07_seams").exists(), "an empty folder is left behind"


@pytest.mark.parametrize(
    "listed",
    ["../outside.jpg", "01_features/../../outside.jpg", "mine.jpg", "{outside}", "01_features/..\\..\\outside.jpg",
     "01_features/keep.txt", "link/outside.jpg", "01_features/link/x.jpg"],
)  # fmt: skip
def test_a_list_that_was_edited_reaches_nothing_else(tmp_path, listed):
    folder, outside = tmp_path / "dump", tmp_path / "outside.jpg"
    Folder(folder)
    (folder / "01_features").mkdir()
    kept = [outside, folder / "mine.jpg", folder / "01_features" / "keep.txt"]
    for path in kept:
        path.write_text("mine")
    data = {"format": "panostitch debug dump", "files": [listed.format(outside=outside), 7, None]}
    (folder / "metrics.json").write_text(json.dumps(data))
    Folder(folder, overwrite=True)
    assert all(path.exists() for path in kept)


def test_a_subfolder_that_points_elsewhere_is_left_alone(tmp_path):
    folder, elsewhere = tmp_path / "dump", tmp_path / "elsewhere"
    Folder(folder)
    elsewhere.mkdir()
    (elsewhere / "a.jpg").write_text("mine")
    (folder / "01_features").symlink_to(elsewhere)
    (folder / "metrics.json").write_text(
        json.dumps({"format": "panostitch debug dump", "files": ["01_features/a.jpg"]})
    )
    Folder(folder, overwrite=True)
    assert (elsewhere / "a.jpg").read_text() == "mine"


@pytest.mark.parametrize(
    "text", ['{"accuracy": 1}', "no json", "[]", '{"format": "panostitch debug dump"}', '{"files": []}']
)
def test_a_metrics_file_of_another_program_is_not_replaced(tmp_path, text):
    (tmp_path / "metrics.json").write_text(text)
    with pytest.raises(OutputError, match="is not from a debug dump"):
        Dump(tmp_path, overwrite=True)
    assert (tmp_path / "metrics.json").read_text() == text


def test_a_picture_never_replaces_a_file_of_the_user(run, tmp_path):
    mine = tmp_path / "10_panorama" / "panorama.jpg"
    mine.parent.mkdir()
    mine.write_text("mine")
    with Dump(tmp_path, overwrite=True) as dump:
        run.send_render(dump)
    assert mine.read_text() == "mine"
    data = json.loads((tmp_path / "metrics.json").read_text())
    assert [failure["what"] for failure in data["failed"]] == ["10_panorama/panorama.jpg"]
    assert "10_panorama/panorama.jpg" not in data["files"]


def test_a_folder_that_cannot_be_made_is_an_error_of_output(tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(OutputError, match="cannot write to the debug folder"):
            Dump(folder)


def test_a_folder_that_vanishes_is_noted_and_said_at_the_end(run, tmp_path):
    folder = tmp_path / "dump"
    dump = Dump(folder)
    (folder / "metrics.json").unlink()
    folder.rmdir()
    run.send_render(dump)
    with pytest.raises(OutputError, match=r"cannot write metrics\.json"):
        dump.close()


@pytest.mark.parametrize(
    ("name", "stem"),
    [("IMG_1.JPG", "IMG_1"), ("a/b.png", "a_b"), ("../x.jpg", "x"), ("a -- b.tif", "a_-_b"), ("con.jpg", "con_"),
     ("...", "photo"), ("été.jpg", "été"), ("v1.2 final.jpg", "v1.2_final")],
)  # fmt: skip
def test_names_are_cleaned(name, stem):
    assert clean(name) == stem


def test_names_are_kept_short_and_apart():
    names = FileNames()
    given = [names.of(name) for name in ("é" * 300, "é" * 301, "É" * 300, "é" * 300)]
    assert given[0] == given[3]
    assert len({stem.casefold() for stem in given}) == 3
    assert all(len(stem.encode()) <= LONGEST_BYTES + 2 for stem in given)


def test_no_name_can_be_mistaken_for_a_pair():
    names = ["a--b", "a-", "-b", "--", "a - - b", "a---"]
    given = FileNames()
    for stem in map(given.of, names):
        assert "--" not in stem
        assert stem == stem.strip("-")
    assert Path(given.of("x/y")).name == given.of("x/y")
