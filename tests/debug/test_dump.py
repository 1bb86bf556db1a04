"""A dump of a whole run: pictures, numbers, and what happens when something fails."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from panostitch.debug import Dump, diagram, draw
from panostitch.debug.dump import encode
from panostitch.errors import InputError
from panostitch.model.alignment import LocalWarp
from panostitch.model.match import Groups
from panostitch.model.mesh import flat_mesh
from panostitch.model.photo import Photo

LONGEST = 1600
ANGLE_TOLERANCE = 1e-6  # degrees; closed form

PICTURES = {
    "01_features/a.jpg", "01_features/b.jpg", "01_features/c.jpg",
    "02_matches/a--b_1_raw.jpg", "02_matches/a--b_2_ratio.jpg", "02_matches/a--b_3_verified.jpg",
    "02_matches/a--c_1_raw.jpg", "02_matches/a--c_2_ratio.jpg", "02_matches/a--c_3_refused.jpg",
    "02_matches/b--c_1_raw.jpg", "02_matches/b--c_2_ratio.jpg", "02_matches/b--c_3_refused.jpg",
    "03_links/graph.png", "04_alignment/layout.png", "05_warped/a.jpg", "05_warped/b.jpg",
    "06_exposure/before.jpg", "06_exposure/after.jpg", "06_exposure/gains.png",
    "07_seams/seams.jpg", "07_seams/labels.png", "08_blend/band_0.jpg", "08_blend/lowpass.jpg",
    "09_crop/crop.jpg", "10_panorama/panorama.jpg",
}  # fmt: skip


def written(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def metrics(folder: Path) -> dict[str, Any]:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    return json.loads((folder / "metrics.json").read_text(), parse_constant=refuse)


@pytest.fixture(scope="module")
def folder(run, tmp_path_factory):
    """The folder of one whole run."""
    folder = tmp_path_factory.mktemp("dump") / "new" / "folder"
    with Dump(folder) as dump:
        run.send(dump)
    return folder


def test_every_event_gives_its_pictures(folder):
    assert written(folder) == PICTURES | {"metrics.json"}
    assert metrics(folder)["failed"] == []
    assert set(metrics(folder)["files"]) == PICTURES
    for name in PICTURES:
        picture = cv2.imread(str(folder / name))
        assert picture is not None, name
        assert picture.shape[2] == 3


@pytest.mark.parametrize(
    ("photo_size", "canvas_size"), [((1900, 700), (2500, 300)), ((300, 1900), (200, 2500)), ((20, 9), (9, 2000))]
)
def test_no_side_is_longer_than_1600(make, tmp_path, photo_size, canvas_size):
    with Dump(tmp_path) as dump:
        make.run(photo_size=photo_size, canvas_size=canvas_size).send(dump)
    assert metrics(tmp_path)["failed"] == []
    for name in PICTURES:
        assert max(cv2.imread(str(tmp_path / name)).shape) <= LONGEST, name


def test_no_picture_is_stored_larger():
    stored = cv2.imdecode(np.frombuffer(encode(np.zeros((10, 4000, 3), np.uint8), ".png"), np.uint8), cv2.IMREAD_COLOR)
    assert stored.shape == (4, LONGEST, 3)


def recorded(monkeypatch, module, name):
    """Calls of a drawing function, which is replaced by one that draws nothing."""
    calls = []

    def record(*args: Any, **_: Any) -> Any:
        calls.append(args)
        return np.zeros((8, 8, 3), np.uint8)

    monkeypatch.setattr(module, name, record)
    return calls


def test_what_is_drawn_on_a_reduced_photo_is_moved_along(make, tmp_path, monkeypatch):
    circles, pairs = recorded(monkeypatch, draw, "features"), recorded(monkeypatch, draw, "matches")
    photos = [make.photo(name, (3200, 400)) for name in "ab"]
    features = [make.features(30, (3200, 400))] * 2
    match, link = make.pair(0, 1, features, 20)
    with Dump(tmp_path) as dump:
        dump("features.detected", index=0, photo=photos[0], features=features[0])
        dump("matching.linked", photos=photos, features=features, match=match, link=link)
    # half the size, by the rule of pixel centres
    assert circles[0][1] == pytest.approx((features[0].xy + 0.5) / 2 - 0.5)
    assert circles[0][2] == pytest.approx(features[0].scale / 2)
    small = (features[0].xy + 0.5) * (796 / 3200) - 0.5
    good = pairs[2][2][1]
    for ends in (good.left, good.right):
        assert ends[:, 0] == pytest.approx(small[:20, 0], abs=0.01)
        # the height of the small photo is rounded to whole px
        assert ends[:, 1] == pytest.approx(small[:20, 1], abs=0.6)


def test_the_graph_shows_refused_pairs_that_came_close(run, tmp_path, monkeypatch):
    graphs = recorded(monkeypatch, diagram, "graph")
    with Dump(tmp_path) as dump:
        run.send_align(dump)
    names, _, groups, edges = graphs[0]
    assert (names, groups) == (["a.jpg", "b.jpg", "c.jpg"], [0, 0, None])
    # 6 of 12 needed is close, 1 of 12 is not
    assert edges == [diagram.Edge(0, 1, 20), diagram.Edge(0, 2, 6, sound=False)]


def test_numbers_of_photos_and_pairs(folder):
    data = metrics(folder)
    assert data["format"] == "panostitch debug dump"
    assert data["version"] == 1
    assert data["photos"][0] == {"name": "a.jpg", "size": [240, 180], "key_points": 40, "group": 1, "used": True}
    assert data["photos"][2]["group"] is None
    assert data["photos"][2]["used"] is False
    assert data["photos"][2]["left_out"] == "overlaps nothing"
    linked, refused, _ = data["pairs"]
    assert linked["photos"] == ["a.jpg", "b.jpg"]
    assert (linked["raw"], linked["after_ratio"], linked["inliers"], linked["overlap"]) == (40, 22, 20, 0.4)
    assert linked["error_px"] is None, "NaN has no place in JSON"
    assert (refused["inliers"], refused["needed"], refused["reason"]) == (6, 12, "too few agree")
    assert not refused["linked"]
    assert data["pairs_not_drawn"] == []


def test_numbers_of_cameras_and_canvas(folder):
    data = metrics(folder)
    alignment = data["alignment"]
    assert (alignment["model"], alignment["reason"]) == ("rotation", "fits best")
    assert (alignment["rms_px"], alignment["p95_px"]) == (0.5, 1.25)
    camera = alignment["cameras"][0]
    assert camera["focal_px"] == pytest.approx(288)
    angles = [camera[f"{name}_degrees"] for name in ("yaw", "pitch", "roll")]
    assert angles == pytest.approx(np.degrees([-0.3, 0.1, -0.2]), abs=ANGLE_TOLERANCE)
    assert data["canvas"]["projection"] == "cylindrical"
    assert data["canvas"]["reason"] == "wide"
    assert data["gains"] == {"a.jpg": 0.9, "b.jpg": None}
    assert data["shares"] == pytest.approx({"a.jpg": 0.5, "b.jpg": 0.5})
    assert data["sizes"]["panorama"] == [400, 200]
    assert data["crop"]["reason"] == "no empty corners"


def test_seconds_are_those_of_the_last_event_of_a_stage(run, tmp_path):
    ticks = iter(range(10_000))
    with Dump(tmp_path, clock=lambda: float(next(ticks))) as dump:
        run.send_align(dump)
        dump("panorama.written", path="", size=(1, 1), preview=np.zeros((1, 1, 3), np.uint8))
    seconds = metrics(tmp_path)["seconds"]
    stages = ["photos", "features", "matching", "alignment", "layout", "panorama"]
    assert list(seconds) == stages
    assert sorted(seconds.values()) == [seconds[stage] for stage in stages]
    assert seconds["features"] > seconds["photos"] + 1, "three photos were searched"


def test_unknown_events_are_ignored(tmp_path):
    with Dump(tmp_path) as dump:
        for event in ("future.event", "not_drawn", "as.json", "finish", "", "photos.read.more"):
            dump(event, value=object())
    assert written(tmp_path) == {"metrics.json"}
    assert metrics(tmp_path)["failed"] == []
    assert metrics(tmp_path)["seconds"] == {}


def test_more_data_than_expected_does_no_harm(run, tmp_path):
    with Dump(tmp_path) as dump:
        run.send_render(lambda event, **data: dump(event, surprise=1, **data))
    assert "10_panorama/panorama.jpg" in written(tmp_path)


HOSTILE = (
    "../../escape.jpg", "..", "/etc/passwd", "a/b.jpg", "a b.jpg", "a_b.jpg", "A_B.JPG", "a_b_2.jpg", "x" * 400,
    "x" * 400 + ".jpg", "写真.jpg", "ärger.jpg", "\udcff.jpg", "CON.jpg", "nul\0.jpg", ".hidden.jpg", "a--b.jpg", "",
)  # fmt: skip


def test_hostile_names_stay_inside_and_apart(make, tmp_path):
    inner = tmp_path / "inner"
    photos = [make.photo(name, (60, 40)) for name in HOSTILE]
    features = [make.features(5, (60, 40))] * len(photos)
    with Dump(inner) as dump:
        dump("photos.read", photos=photos)
        for index, photo in enumerate(photos):
            dump("features.detected", index=index, photo=photo, features=features[index])
        for j in range(1, len(photos)):
            match, link = make.pair(0, j, features, 1, needed=9)
            dump("matching.linked", photos=photos, features=features, match=match, link=link)
        dump("matching.grouped", photos=photos, links=[], groups=Groups((), tuple(range(len(photos)))))
    data = metrics(inner)
    assert data["failed"] == []
    assert list(tmp_path.iterdir()) == [inner]
    assert len(list((inner / "01_features").iterdir())) == len(HOSTILE)
    assert len(list((inner / "02_matches").iterdir())) == 3 * (len(HOSTILE) - 1)
    names = [path.name.casefold() for path in (inner / "01_features").iterdir()]
    assert len(set(names)) == len(HOSTILE)


@pytest.fixture
def tiny_pictures(monkeypatch):
    """Pairs drawn as single colours: for tests that need many of them."""
    monkeypatch.setattr(draw, "matches", lambda *_, **__: np.zeros((8, 8, 3), np.uint8))


@pytest.mark.usefixtures("tiny_pictures")
def test_of_many_pairs_the_telling_ones_are_drawn(make, tmp_path):
    photos = [make.photo(f"{k:02}.jpg", (16, 12)) for k in range(16)]
    features = [make.features(50)] * len(photos)
    tried = [(i, j) for i in range(16) for j in range(i + 1, 16)]
    with Dump(tmp_path) as dump:
        for i, j in tried:
            link = j == i + 1
            match, outcome = make.pair(i, j, features, 10 if link else i, needed=0 if link else 40)
            dump("matching.linked", photos=photos, features=features, match=match, link=outcome)
            assert not (tmp_path / "02_matches").exists(), "drawn before all pairs are known"
        dump("matching.grouped", photos=photos, links=[], groups=Groups((tuple(range(16)),), ()))
    files = written(tmp_path)
    assert sum(name.endswith("_3_verified.jpg") for name in files) == 15
    refused = {name for name in files if name.endswith("_3_refused.jpg")}
    assert len(refused) == 60 - 15
    # most inliers first: with i inliers that is the end of the list
    assert "02_matches/13--15_3_refused.jpg" in refused
    assert "02_matches/00--15_3_refused.jpg" not in refused
    not_drawn = metrics(tmp_path)["pairs_not_drawn"]
    assert len(not_drawn) == len(tried) - 60
    assert ["00.jpg", "15.jpg"] in not_drawn


@pytest.mark.usefixtures("tiny_pictures")
def test_pairs_that_were_never_grouped_are_drawn_at_the_end(make, tmp_path):
    photos, features = [make.photo("a"), make.photo("b")], [make.features(9)] * 2
    match, link = make.pair(0, 1, features, 3, needed=9)
    dump = Dump(tmp_path)
    dump("matching.linked", photos=photos, features=features, match=match, link=link)
    assert written(tmp_path) == {"metrics.json"}
    dump.close()
    assert "02_matches/a--b_3_refused.jpg" in written(tmp_path)


@pytest.mark.usefixtures("tiny_pictures")
def test_a_link_that_is_dropped_later_becomes_a_refusal(make, tmp_path):
    photos, features = [make.photo("a"), make.photo("b")], [make.features(30)] * 2
    match, link = make.pair(0, 1, features, 20)
    _, dropped = make.pair(0, 1, features, 20, needed=99)
    with Dump(tmp_path) as dump:
        for final in (link, dropped):
            dump("matching.linked", photos=photos, features=features, match=match, link=link)
            dump("matching.grouped", photos=photos, links=[final], groups=Groups((), (0, 1)))
    assert "02_matches/a--b_3_refused.jpg" in written(tmp_path)
    assert "02_matches/a--b_3_verified.jpg" not in written(tmp_path)
    assert metrics(tmp_path)["pairs"][0]["reason"] == "too few agree"


@pytest.mark.parametrize(
    "error", [cv2.error("assertion"), ValueError("odd"), OSError("full"), InputError("gone"), ZeroDivisionError("0")]
)
def test_a_picture_that_fails_is_noted_and_the_others_are_made(run, tmp_path, monkeypatch, error):
    def fail(*_: Any, **__: Any) -> None:
        raise error

    monkeypatch.setattr(draw, "seams", fail)
    with Dump(tmp_path) as dump:
        run.send_render(dump)
    assert "07_seams/labels.png" in written(tmp_path)
    assert "10_panorama/panorama.jpg" in written(tmp_path)
    assert "07_seams/seams.jpg" not in written(tmp_path)
    (failure,) = metrics(tmp_path)["failed"]
    assert failure["what"] == "07_seams/seams.jpg"
    assert str(error) in failure["error"]


def test_a_photo_that_cannot_be_read_stops_nothing(run, make, tmp_path):
    class Gone:
        def read(self, scale: float = 1.0) -> Any:
            raise InputError(f"gone at {scale}")

    with Dump(tmp_path) as dump:
        dump("features.detected", index=0, photo=Photo("a.jpg", (9, 9), Gone()), features=make.features(3))
        run.send_render(dump)
    assert {failure["what"] for failure in metrics(tmp_path)["failed"]} >= {"01_features/a.jpg"}
    assert "10_panorama/panorama.jpg" in written(tmp_path)


def test_a_bug_in_a_stage_is_not_hidden(tmp_path):
    with Dump(tmp_path) as dump, pytest.raises(TypeError):
        dump("layout.chosen")


def test_numbers_are_there_after_a_crash(run, tmp_path):
    def crash() -> None:
        with Dump(tmp_path) as dump:
            run.send_align(dump)
            raise RuntimeError("bug")

    with pytest.raises(RuntimeError, match="bug"):
        crash()
    assert metrics(tmp_path)["alignment"]["rms_px"] == 0.5
    assert "panorama" not in metrics(tmp_path)


def test_numbers_are_written_on_the_way(run, tmp_path):
    hours = iter(range(10_000))
    dump = Dump(tmp_path, clock=lambda: 3600.0 * next(hours))
    run.send_align(dump)
    # not closed, as if killed: what is there can still be cleared by the next run
    listed = set(metrics(tmp_path)["files"])
    assert listed == written(tmp_path) - {"metrics.json"}


def test_closed_means_closed(run, tmp_path):
    dump = Dump(tmp_path)
    dump.close()
    run.send(dump)
    dump.close()
    assert written(tmp_path) == {"metrics.json"}


def test_meshes_are_drawn_and_noted(tmp_path, run):
    plain = run.alignment
    mesh = flat_mesh(run.photo_size)
    mesh = replace(mesh, nodes=mesh.nodes + 1.5)
    alignment = replace(
        plain,
        cameras=(replace(plain.cameras[0], mesh=mesh), plain.cameras[1]),
        local_warp=LocalWarp(True, 40, 1.5, 1.1, 0.3, 0.2),
    )

    with Dump(tmp_path / "d") as dump:
        dump("photos.read", photos=run.photos)
        dump("alignment.bent", alignment=alignment)

    data = json.loads((tmp_path / "d" / "metrics.json").read_text())
    assert data["failed"] == []
    assert [name for name in data["files"] if "mesh_" in name] == [data["files"][-1]]
    assert data["local_warp"]["bent_rms"] == 0.3
    (largest,) = data["local_warp"]["largest_px"].values()
    assert largest == pytest.approx(1.5 * np.sqrt(2))
