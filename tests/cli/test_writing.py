"""What `render` says before it writes, `--dry-run`, `--resume`, and pictures of a given size."""

import json
import os

import pytest
from PIL import Image

from panostitch.io.limits import SIDES

OK, USAGE, LIMIT = 0, 2, 7
QUICK = ["--seams", "voronoi", "--blender", "none", "--exposure", "none"]


@pytest.fixture(scope="module")
def project(photos, tmp_path_factory):
    from panostitch.cli.main import run

    path = tmp_path_factory.mktemp("project") / "given.pano.json"
    assert run(["align", *(str(photos / f"{name}.jpg") for name in "abc"), "-o", str(path), "-q"]) == OK
    return path


@pytest.fixture
def render(call, project):
    return lambda *arguments: call("render", project, "-o", *arguments, *QUICK)


def test_a_dry_run_says_all_and_writes_nothing(render):
    result = render("out.tif", "--dry-run", "--json")

    assert result.code == OK
    assert os.listdir() == []
    said = dict(line.split(": ", 1) for line in result.err.splitlines())
    data = json.loads(result.out)
    width, height = data["panorama"]["size"]
    assert said["out.tif"].startswith(f"would be {width} x {height} px ({width * height / 1e6:.1f} megapixels)")
    assert said["projection"] == f"rectilinear ({data['panorama']['projection_reason']})"
    across, down = data["panorama"]["field_of_view"]
    assert 70 < across < 86  # degrees: three photos of 50, 17 apart, and the crop may take a bit
    assert said["field of view"] == f"{across:.1f} x {down:.1f} degrees"
    assert data["panorama"]["path"] == ""
    assert data["forecast"]["seconds"] > 0
    assert data["forecast"]["memory"] > 50 << 20  # bytes: the program alone takes that
    assert said["time"].startswith(f"about {data['forecast']['seconds']:.1f} s")

    assert render("out.tif", "--json").code == OK
    with Image.open("out.tif") as image:
        assert image.size == (width, height)


def test_a_dry_run_refuses_what_the_run_would(render, monkeypatch):
    monkeypatch.setitem(SIDES, ".jpg", 500)

    assert render("out.jpg", "--dry-run").code == LIMIT


@pytest.mark.parametrize("other", [["--debug-dir", "why"], ["--resume"]])
def test_a_dry_run_with_something_to_write_is_refused(other, render):
    result = render("out.jpg", "--dry-run", *other)

    assert result.code == USAGE
    assert other[0] in result.err
    assert os.listdir() == []


def test_size_and_memory_are_said_before_and_not_when_quiet(render):
    said = render("out.jpg").err.splitlines()

    assert said[0].startswith("writing ")
    assert "megapixels) to out.jpg, in up to " in said[0]
    assert render("quiet.jpg", "-q").err == ""


def test_a_run_with_resume_leaves_the_panorama_only(render):
    assert render("plain.png").code == OK
    result = render("out.png", "--resume")

    assert result.code == OK
    assert sorted(os.listdir()) == ["out.png", "plain.png"]
    with open("out.png", "rb") as one, open("plain.png", "rb") as other:
        assert one.read() == other.read()


def test_an_interruption_keeps_what_resume_goes_on_from(render, monkeypatch):
    def interrupted(_file, _path, picture, *_):
        next(picture.map(lambda region, _: region))
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("panostitch.io.writers.encode_panorama", interrupted)
        first = render("out.png", "--resume")
    assert first.code == 130
    assert "out.png.partial: the same command goes on" in first.err
    assert os.listdir() == ["out.png.partial"]

    again = render("out.png", "--resume")
    assert "out.png.partial: going on: 1 of " in again.err
    assert not os.path.exists("out.png.partial")


@pytest.mark.parametrize(
    ("options", "size"), [(["--size", "333"], (333, None)), (["--size", "x100", "--crop", "full"], (None, 100))]
)
def test_a_size(options, size, render):
    assert render("out.png", *options).code == OK
    with Image.open("out.png") as image:
        assert image.mode == "RGB"
        assert all(own == side for own, side in zip(image.size, size, strict=True) if side)


@pytest.mark.parametrize(
    "options", [["--size", "big"], ["--fov", "400"], ["--crop", "most"], ["--size", "100", "--scale", "0.5"]]
)
def test_what_makes_no_sense_is_said_before_photos_are_read(options, call):
    result = call("no.jpg", "such.jpg", "-o", "out.jpg", *options)

    assert result.code == USAGE
    assert options[0] in result.err
    assert "  next: " in result.err
