"""What is told of a project file."""

import json

import pytest

from panostitch.cli.main import run
from panostitch.errors import InputError
from panostitch.io.project import read_project
from panostitch.jobs.inspect import inspect_project

QUICK = ["--detector", "orb", "--max-features", "600", "--retries", "none", "--refine", "none", "-q"]


@pytest.fixture(scope="module")
def project(tmp_path_factory, views):
    """A project of three photos and one that was left out, with the .pto beside it."""
    from PIL import Image

    folder = tmp_path_factory.mktemp("project")
    for name, pixels in zip("abcd", views, strict=True):
        Image.fromarray(pixels).save(folder / f"{name}.jpg", quality=95)
    photos = [str(folder / f"{name}.jpg") for name in "abcd"]
    assert run(["align", *photos, "-o", str(folder / "x.pano.json"), "--pto", str(folder / "x.pto"), *QUICK]) == 3
    return folder


def changed(project, name, change):
    """A copy of the project in which something is different."""
    data = json.loads((project / "x.pano.json").read_text())
    change(data)
    path = project / name
    path.write_text(json.dumps(data))
    return str(path)


def test_ours(project):
    found = inspect_project(str(project / "x.pano.json"))

    assert found.format == "panostitch project"
    assert [photo.name for photo in found.alignment.photos] == ["a.jpg", "b.jpg", "c.jpg"]
    assert [photo.name for photo in found.alignment.left_out] == ["d.jpg"]
    assert found.missing == ()
    assert found.projection == "rectilinear"
    # three views of 50 degrees, 17 apart
    assert found.field_of_view[0] == pytest.approx(84, abs=3)
    assert 650 < found.canvas[0] < 900


def test_hugins(project):
    ours, theirs = (inspect_project(str(project / name)) for name in ("x.pano.json", "x.pto"))

    assert theirs.format == "Hugin project"
    assert theirs.canvas == pytest.approx(ours.canvas, abs=2)
    assert theirs.field_of_view == pytest.approx(ours.field_of_view, abs=0.3)


def test_a_photo_that_is_missing_is_told_and_the_rest_is_known(project):
    path = changed(project, "gone.pano.json", lambda data: data["photos"][1].update(path="gone.jpg"))

    found, whole = inspect_project(path), inspect_project(str(project / "x.pano.json"))

    (line,) = found.missing
    assert "gone.jpg: no such file" in line
    assert found.canvas == whole.canvas
    with pytest.raises(InputError, match=r"gone\.jpg"):
        found.alignment.photos[1].source.read()
    with pytest.raises(InputError, match=r"gone\.jpg"):
        read_project(path)


def test_cameras_that_make_no_canvas_are_told_with_the_reason(project):
    def flat(data):
        data["model"] = "homography"
        data["photos"][0]["cam_from_world"] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]

    found = inspect_project(changed(project, "apart.pano.json", flat))

    assert (found.canvas, found.field_of_view, found.projection) == (None, None, "")
    assert "horizon of the plane" in found.reason


DAMAGE = {
    "not ours": lambda data: data.pop("format"),
    "a link of no photo": lambda data: data["links"][0].update(i=99),
    "a link of words": lambda data: data["links"][0].update(j="b"),
    "links that are none": lambda data: data.update(links=5),
    "a photo without a name": lambda data: data["photos"][0].pop("path"),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_damage(case, project):
    with pytest.raises(InputError, match="not a sound project file"):
        inspect_project(changed(project, "damaged.pano.json", DAMAGE[case]))


def test_left_outs_of_the_wrong_kind_are_words_all_the_same(project):
    left_out = [{"name": 1, "reason": 2, "details": [3], "hint": 4, "cause": 5}]
    path = changed(project, "odd.pano.json", lambda data: data.update(left_out=left_out))

    (photo,) = inspect_project(path).alignment.left_out

    assert (photo.name, photo.reason, photo.details, photo.hint, photo.cause) == ("1", "2", ("3",), "4", "5")
