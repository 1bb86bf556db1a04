"""The page itself: well formed, whole without a network, harmless with hostile names, the same every time."""

import base64
import io
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from PIL import Image

from panostitch.errors import MissingError
from panostitch.report import check_installed, write_report
from panostitch.report.album import PHOTOS_BYTES, photos_shown
from panostitch.report.record import Record

from .conftest import HOSTILE, OPTIONS, named

VOID = {"meta", "img", "input", "br"}
LOADS = {"src", "href", "srcset", "data", "poster", "action", "background", "xlink:href"}


class Page(HTMLParser):
    """Elements as (name, attributes), the visible text, and what is wrong with the nesting."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.wrong: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        self.close()
        self.wrong += [f"<{name}> is not closed" for name in self._open]

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if len({name for name, _ in attrs}) != len(attrs):
            self.wrong.append(f"<{tag}> has an attribute twice")
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        if not self._open or self._open[-1] != tag:
            self.wrong.append(f"</{tag}> closes {self._open[-1:]}")
        else:
            self._open.pop()

    def handle_data(self, data):
        if self._open and self._open[-1] not in ("script", "style"):
            self.words.append(data)

    def all(self, name: str) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes in self.elements if tag == name]


def test_the_html_is_well_formed(either):
    page = Page(either.text)

    assert page.wrong == []
    assert either.text.lstrip().lower().startswith("<!doctype html>")
    ids = [a["id"] for _, a in page.elements if "id" in a]
    assert len(ids) == len(set(ids))


def test_nothing_is_loaded_from_elsewhere(either):
    page = Page(either.text)
    ids = {a["id"] for _, a in page.elements if "id" in a}

    targets = [value or "" for _, a in page.elements for name, value in a.items() if name in LOADS]
    assert targets
    for target in targets:
        assert target.startswith("data:image/") or target[1:] in ids, target[:80]
    assert not re.search(r"https?:|url\(|@import", either.text)
    assert len(either.page.read_bytes()) < 10_000_000


def test_every_picture_decodes(either):
    uris = re.findall(r'"data:image/(\w+);base64,([^"]*)"', either.text)

    assert len(uris) == either.text.count("data:image/")
    for kind, data in uris:
        picture = Image.open(io.BytesIO(base64.b64decode(data, validate=True)))
        picture.load()
        assert picture.format == kind.upper()
    assert len(uris) >= len(either.record.photos)


def test_hostile_names_are_text(either):
    page = Page(either.text)

    assert HOSTILE in "".join(page.words)
    assert "<script>alert" not in either.text
    assert len(page.all("script")) == 1
    policy = next(a["content"] for a in page.all("meta") if a.get("http-equiv") == "Content-Security-Policy")
    assert "default-src 'none'" in policy
    assert "script-src 'sha256-" in policy


def test_buttons_and_fields_have_names(made):
    page = Page(made.text)

    assert [a["data-shows"] for a in page.all("button")] == ["seams", "outlines"]
    assert [a["for"] for a in page.all("label")] == [a["id"] for a in page.all("input")] == ["share"]
    assert page.all("input")[0]["type"] == "range"
    for attributes in page.all("img"):
        assert attributes["alt"]
    for tag, attributes in page.elements:
        assert attributes.get("role") != "img" or attributes["aria-label"], tag


def test_a_whole_run_has_every_part(made):
    parts = [a["id"] for a in Page(made.text).all("section")]

    assert parts == ["panorama", "failures", "photos", "links", "exposure", "seams", "cameras", "time", "options"]


def test_a_failed_run_says_what_is_known(failed):
    page, words = Page(failed.text), " ".join("".join(Page(failed.text).words).split())

    assert [a["id"] for a in page.all("section")] == ["failures", "photos", "links", "time", "options"]
    assert "Failed with exit code 4: no two photos overlap" in words
    assert "Cause: different scene." in words
    assert "Next:" in words


def test_options_that_differ_are_said_first(made):
    words = "".join(Page(made.text).words)

    before, _, after = words.rpartition("All options")
    assert "--ratio 0.75" in before
    assert "--seed" not in before
    assert "--seed 0" in after


def test_the_same_run_gives_the_same_bytes(made, stitch, tmp_path):
    again = stitch()
    again.path = made.record.path
    write_report(again, str(tmp_path / "again.html"), OPTIONS)

    assert (tmp_path / "again.html").read_bytes() == made.page.read_bytes()


def test_a_run_that_ends_before_anything_is_known_has_a_report(tmp_path):
    write_report(Record(), str(tmp_path / "empty.html"), OPTIONS, error=MissingError("nothing", hint="try again"))

    page = Page((tmp_path / "empty.html").read_text())
    assert page.wrong == []
    assert "nothing" in "".join(page.words)


def test_names_that_are_no_unicode_are_written(views, tmp_path):
    record = Record()
    record("photos.read", photos=named(views, ("a\udcff.jpg", "b", "c", "d")))
    write_report(record, str(tmp_path / "odd.html"), OPTIONS)

    assert "a?.jpg" in (tmp_path / "odd.html").read_text(encoding="utf-8")


def test_many_photos_are_made_smaller(rng):
    noise = rng.integers(0, 256, (300, 400, 3), "uint8")
    photos = {str(n): photo for n, photo in enumerate(named([noise] * 60, tuple(map(str, range(60)))))}

    pictures = photos_shown(photos)

    assert len(pictures) == 60
    assert sum(len(p.uri) for p in pictures.values()) <= 4 / 3 * PHOTOS_BYTES + 60 * 40
    assert len({p.size for p in pictures.values()}) == 1


def test_without_jinja_the_line_that_installs_it_is_said(monkeypatch):
    monkeypatch.setattr("panostitch.report.write.find_spec", lambda _: None)

    with pytest.raises(MissingError) as caught:
        check_installed()

    assert "pip install 'panostitch[report]'" in caught.value.hint
    assert caught.value.exit_code == 9


def test_the_parts_of_the_page_are_in_the_package():
    import tomllib

    settings = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())
    assert "report/page/*" in settings["tool"]["setuptools"]["package-data"]["panostitch"]
