"""What the documentation points at is there, and no picture lies about that nothing shows."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "samples").glob("*.md")])
IMAGES = ROOT / "docs" / "images"


def targets(page):
    """Files that a page links to."""
    links = re.findall(r"\]\(([^)\s]+)\)", page.read_text())
    return [page.parent / link.split("#")[0] for link in links if not re.match(r"[a-z]+:|#", link)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    assert [str(target) for target in targets(page) if not target.exists()] == []


def test_every_picture_is_shown_and_made_by_the_script():
    spec = importlib.util.spec_from_file_location("make_pictures", ROOT / "docs" / "make_pictures.py")
    script = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(__import__("sys").modules, spec.name, script)  # dataclasses look themselves up there
        spec.loader.exec_module(script)
    there = {path.name for path in IMAGES.iterdir()}
    shown = {target.name for page in PAGES for target in targets(page) if target.parent.resolve() == IMAGES}
    assert there == shown == {f"{name}.jpg" for name in (*script.PICTURES, script.DETECTORS)}
