"""An alignment as the content of a project file."""

import json

import numpy as np
import pytest

from panostitch.geometry import rotation
from panostitch.model.alignment import FORMAT, FORMAT_VERSION, Alignment, LeftOut, LinkSummary, camera_from_json
from panostitch.model.camera import Camera


@pytest.fixture
def alignment(memory_photos):
    cameras = tuple(
        Camera((400, 300), 431.7 + n, (199.5 + n / 3, 149.5), rotation.from_angles(0.4 * n, 0.01, -0.02), -0.1, 0.01)
        for n in range(3)
    )
    return Alignment(
        model="rotation",
        photos=tuple(memory_photos[:3]),
        cameras=cameras,
        links=(LinkSummary(0, 1, 55, 0.4), LinkSummary(1, 2, 66, 0.5)),
        left_out=(LeftOut("view_3", "overlaps no other photo", ("best partner: view_1",), "look again", "blur"),),
        rms=0.45,
        p95=0.9,
        reason="it fits",
    )


def through_text(data):
    return json.loads(json.dumps(data, allow_nan=False))


def test_says_what_it_is(alignment):
    data = through_text(alignment.to_json())

    assert (data["format"], data["version"]) == (FORMAT, FORMAT_VERSION)
    assert (data["model"], data["reason"], data["rms"], data["p95"]) == ("rotation", "it fits", 0.45, 0.9)


def test_cameras_come_back_to_the_last_bit(alignment):
    data = through_text(alignment.to_json())

    for entry, camera in zip(data["photos"], alignment.cameras, strict=True):
        back = camera_from_json(entry)
        assert (back.size, back.focal, back.centre) == (camera.size, camera.focal, camera.centre)
        assert (back.k1, back.k2) == (camera.k1, camera.k2)
        np.testing.assert_array_equal(back.cam_from_world, camera.cam_from_world)


def test_links_and_left_out_come_back(alignment):
    data = through_text(alignment.to_json())

    assert tuple(LinkSummary(**link) for link in data["links"]) == alignment.links
    (left_out,) = data["left_out"]
    assert left_out == {
        "name": "view_3",
        "reason": "overlaps no other photo",
        "details": ["best partner: view_1"],
        "hint": "look again",
        "cause": "blur",
    }


NONSENSE = {
    "no matrix": {"cam_from_world": None},
    "too small": {"cam_from_world": [[1, 0], [0, 1]]},
    "ragged": {"cam_from_world": [[1, 0, 0], [0, 1, 0], [0, 0]]},
    "words": {"cam_from_world": "up"},
    "singular": {"cam_from_world": [[1, 0, 0], [0, 1, 0], [0, 0, 0]]},
    "infinite": {"cam_from_world": [[float("inf"), 0, 0], [0, 1, 0], [0, 0, 1]]},
    "focal of nothing": {"focal": 0},
    "focal backwards": {"focal": -400.0},
    "focal not a number": {"focal": float("nan")},
    "focal a list": {"focal": [400]},
    "focal far too large": {"focal": 10**400},
    "centre not a number": {"centre": [float("nan"), 1]},
    "centre of one number": {"centre": [3]},
    "size of one number": {"size": [400]},
    "size of words": {"size": ["a", "b"]},
    "lens not a number": {"k1": float("nan")},
    "lens infinite": {"k2": float("inf")},
    "lens a word": {"k1": "round"},
}
BUGS = {
    "focal far too large": "OverflowError",
    "lens not a number": "k1 and k2 are not looked at",
    "lens infinite": "k1 and k2 are not looked at",
}


@pytest.mark.parametrize("case", NONSENSE)
def test_nonsense_is_no_camera(alignment, case):
    entry = {**through_text(alignment.to_json())["photos"][0], **NONSENSE[case]}

    with pytest.raises((KeyError, TypeError, ValueError, OverflowError)):
        camera_from_json(entry)


@pytest.mark.parametrize("key", ["size", "focal", "centre", "k1", "k2", "cam_from_world"])
def test_what_is_missing_is_named(alignment, key):
    entry = through_text(alignment.to_json())["photos"][0]
    del entry[key]

    with pytest.raises(KeyError, match=key):
        camera_from_json(entry)
