"""The project file: what is written can be read, moved, and is refused in one line where it is broken."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from panostitch.errors import InputError, OutputError
from panostitch.geometry import rotation
from panostitch.io.project import read_project, write_project
from panostitch.io.readers import open_photo
from panostitch.model.alignment import FORMAT_VERSION, Alignment, LeftOut, LinkSummary, LocalWarp
from panostitch.model.camera import Camera
from panostitch.model.finding import Finding
from panostitch.model.mesh import flat_mesh

SIZE = (60, 40)


@pytest.fixture(autouse=True)
def _in_tmp_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def make_alignment(paths):
    for path in paths:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", SIZE).save(path)
    return Alignment(
        "rotation",
        tuple(open_photo(path) for path in paths),
        tuple(
            Camera(SIZE, 50.0 + n / 7, (29.5, 19.5), rotation.from_angles(n / 3, 0, 0), -0.1) for n in range(len(paths))
        ),
        (LinkSummary(0, 1, 55, 0.4),),
        (LeftOut("z.jpg", "overlaps no other photo", ("one", "two"), "look again", "blur"),),
        0.4,
        0.9,
        "it fits",
        findings=(Finding("z.jpg", os.path.basename(paths[0]), "blur", "it is soft", "take it again", "z.jpg", 0.4),),
    )


def same(a, b):
    assert (a.model, a.links, a.left_out, a.rms, a.p95, a.reason) == (
        b.model,
        b.links,
        b.left_out,
        b.rms,
        b.p95,
        b.reason,
    )
    assert a.findings == b.findings
    assert [photo.name for photo in a.photos] == [photo.name for photo in b.photos]
    for p, q in zip(a.cameras, b.cameras, strict=True):
        assert (p.size, p.focal, p.centre, p.k1, p.k2) == (q.size, q.focal, q.centre, q.k1, q.k2)
        np.testing.assert_array_equal(p.cam_from_world, q.cam_from_world)


@pytest.mark.parametrize("path", ["x.pano.json", "sub/x.pano.json", "sub/../x.pano.json"])
@pytest.mark.parametrize("photos", [("a.png", "b.png"), ("photos/a b.png", "elsewhere/ü😀.png")])
def test_round_trip(path, photos):
    Path("sub").mkdir()
    alignment = make_alignment(photos)

    write_project(alignment, path)
    back = read_project(path)

    same(back, alignment)
    for photo, original in zip(back.photos, alignment.photos, strict=True):
        assert os.path.samefile(photo.path, original.path)
        np.testing.assert_array_equal(photo.source.read()[0], original.source.read()[0])


def test_paths_in_the_file_are_relative(tmp_path):
    alignment = make_alignment([str(tmp_path / "photos" / "a.png"), str(tmp_path / "photos" / "b.png")])

    write_project(alignment, str(tmp_path / "out.pano.json"))

    assert str(tmp_path) not in Path("out.pano.json").read_text()


def test_a_folder_can_be_moved(monkeypatch):
    alignment = make_alignment(["old/photos/a.png", "old/photos/b.png"])
    Path("old/work").mkdir()
    write_project(alignment, "old/work/x.pano.json")
    shutil.move("old", "new")

    same(read_project("new/work/x.pano.json"), alignment)
    monkeypatch.chdir("new/work")
    same(read_project("x.pano.json"), alignment)


def test_names_that_are_no_text():
    # Linux allows any bytes in a name; they reach Python as lone surrogates
    names = [os.fsdecode(b"caf\xe9.png"), "b.png"]
    alignment = make_alignment(names)

    write_project(alignment, "x.pano.json")

    same(read_project("x.pano.json"), alignment)


def test_a_folder_that_is_not_there():
    alignment = make_alignment(["a.png", "b.png"])

    with pytest.raises(OutputError, match=r"none/x\.pano\.json"):
        write_project(alignment, "none/x.pano.json")


def test_meshes_and_their_gain_come_back():
    alignment = make_alignment(["a.png", "b.png"])
    mesh = flat_mesh(SIZE)
    mesh = replace(mesh, nodes=np.random.default_rng(1).normal(0, 0.1, mesh.nodes.shape))
    cameras = (replace(alignment.cameras[0], mesh=mesh), alignment.cameras[1])
    alignment = replace(alignment, cameras=cameras, local_warp=LocalWarp(True, 40, 1.5, 1.1, 0.3, 0.2))

    write_project(alignment, "x.pano.json")
    back = read_project("x.pano.json")

    np.testing.assert_array_equal(back.cameras[0].mesh.nodes, mesh.nodes)
    assert back.cameras[1].mesh is None
    assert back.local_warp == alignment.local_warp


def changed(data, *keys, to):
    """Set (or delete, where `to` is Ellipsis) an entry deep inside."""
    place = data
    for key in keys[:-1]:
        place = place[key]
    if to is ...:
        del place[keys[-1]]
    else:
        place[keys[-1]] = to
    return data


# What is broken, and a word of the message.
BROKEN = {
    "another format": (("format",), "something", "panostitch"),
    "no format": (("format",), ..., "format"),
    "next version": (("version",), FORMAT_VERSION + 1, "version"),
    "no version": (("version",), ..., "version"),
    "model unknown": (("model",), "cube", "panorama"),
    "no photos": (("photos",), [], "panorama"),
    "photos missing": (("photos",), ..., "photos"),
    "photos a number": (("photos",), 3, ""),
    "photos a word": (("photos",), "abc", ""),
    "photo without path": (("photos", 0, "path"), ..., "path"),
    "path a number": (("photos", 0, "path"), 7, ""),
    "path null": (("photos", 0, "path"), None, ""),
    "path with a zero": (("photos", 0, "path"), "a\0.png", "no such file"),
    "path of half a character": (("photos", 0, "path"), "\ud800.png", "no such file"),
    "photo gone": (("photos", 0, "path"), "gone.png", "gone.png: no such file"),
    "photo is a folder": (("photos", 0, "path"), ".", "folder"),
    "photo is the project": (("photos", 0, "path"), "x.pano.json", "not a picture"),
    "size of another photo": (("photos", 0, "size"), [61, 40], "61 x 40"),
    "size of one number": (("photos", 0, "size"), [60], ""),
    "size null": (("photos", 0, "size"), None, ""),
    "focal zero": (("photos", 1, "focal"), 0, ""),
    "focal null": (("photos", 1, "focal"), None, ""),
    "focal enormous": (("photos", 1, "focal"), 10**400, ""),
    "k1 not a number": (("photos", 1, "k1"), float("nan"), ""),
    "matrix singular": (("photos", 1, "cam_from_world"), [[0, 0, 0]] * 3, "singular"),
    "matrix ragged": (("photos", 1, "cam_from_world"), [[1, 2], [1]], ""),
    "matrix infinite": (("photos", 1, "cam_from_world"), [[float("inf"), 0, 0], [0, 1, 0], [0, 0, 1]], "finite"),
    "mesh missing": (("photos", 0, "mesh"), ..., "mesh"),
    "mesh a word": (("photos", 0, "mesh"), "flat", ""),
    "mesh too small": (("photos", 0, "mesh"), [[[0, 0]] * 3] * 3, "mesh"),
    "mesh folds": (("photos", 0, "mesh"), [[[0, 0], [99, 0]] * 3] * 4, "folds"),
    "local warp a word": (("local_warp",), "yes", ""),
    "links null": (("links",), None, ""),
    "link of words": (("links", 0), {"from": 1}, ""),
    "left out a number": (("left_out",), 3, ""),
    "left out without reason": (("left_out", 0, "reason"), ..., "reason"),
    "findings missing": (("findings",), ..., "findings"),
    "finding without cause": (("findings", 0, "cause"), ..., "cause"),
    "rms a word": (("rms",), "small", "small"),
    "rms missing": (("rms",), ..., "rms"),
    "reason missing": (("reason",), ..., "reason"),
}


def refused(path):
    with pytest.raises(InputError) as caught:
        read_project(path)
    assert "\n" not in caught.value.message
    assert "Error" not in caught.value.message
    return caught.value.message


BUGS = {
    "size of one number": "IndexError in the message",
    "focal enormous": "OverflowError",
    "k1 not a number": "k1 and k2 are not looked at",
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_project_is_refused_in_one_line(case):
    keys, value, word = BROKEN[case]
    write_project(make_alignment(["a.png", "b.png"]), "x.pano.json")
    data = json.loads(Path("x.pano.json").read_text())
    Path("x.pano.json").write_text(json.dumps(changed(data, *keys, to=value)))

    assert word in refused("x.pano.json")


NO_PROJECT = {
    "nothing": b"",
    "text": b"Dear reader,",
    "half": b'{"format": "panostitch alignment", "vers',
    "a list": b"[1, 2]",
    "a number": b"3",
    "null": b"null",
    "not UTF-8": b'{"format": "\xff\xfe"}',
    "a picture": b"\x89PNG\r\n\x1a\n" + bytes(range(256)),
    "endless brackets": b"[" * 100_000,
    "endless number": b'{"version": ' + b"9" * 10_000 + b"}",
}


@pytest.mark.parametrize("case", NO_PROJECT)
def test_what_is_no_project_is_refused_by_name(case):
    Path("x.pano.json").write_bytes(NO_PROJECT[case])

    assert "x.pano.json" in refused("x.pano.json")


def test_a_project_that_is_not_there():
    assert refused("none.pano.json") == "none.pano.json: no such file"


def test_a_folder_is_no_project():
    Path("folder.pano.json").mkdir()

    assert "folder.pano.json" in refused("folder.pano.json")
