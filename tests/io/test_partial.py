"""Runs that go on from finished tiles end in the same bytes as runs that were never stopped."""

import os
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from compositing.mosaics import alignment_of, shifted
from panostitch.errors import LimitError, OutputError
from panostitch.io.partial import fingerprint, finished_tiles
from panostitch.io.rendering import tiles_of
from panostitch.io.writers import write_panorama
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.light import unchanged
from panostitch.model.panorama import Panorama, Plan
from panostitch.options import Options, OutputOptions
from panostitch.runtime.executor import Executor

CROP = Region(13, 5, 1107, 1301)  # six tiles, most of them no whole ones
TILES = len(tiles_of(CROP))
BEFORE_THE_KILL = 4  # tiles


def computed(region):
    y, x = np.mgrid[region.y : region.bottom, region.x : region.right].astype(np.int32)
    mask = (x - 600) ** 2 + (y - 600) ** 2 > 300**2
    pixels = np.stack([x // 3 % 256, y // 2 % 256, (x + y) % 251], axis=-1)
    return Layer(region, np.where(mask[..., None], pixels, 0).astype(np.float32), mask)


def panorama_of(read=computed, *, covered=False, crop=CROP):
    plan = Plan(unchanged(1), 1, np.zeros((1, 1), np.int16), (), crop, "as asked", covered)
    return Panorama(Canvas("cylindrical", 100.0, (0.0, 0.0), (crop.right, crop.bottom)), plan, read)


def write(path, read=computed, *, key="key", covered=False, **options):
    """Write with --resume; what was said of the tiles that were there."""
    panorama = panorama_of(read, covered=covered)
    with finished_tiles(str(path), key, panorama) as finished:
        write_panorama(panorama, str(path), OutputOptions(**options), run=Executor(2), finished=finished)
    return finished.note


def whole(path, *, covered=False, **options):
    """The bytes of a run that nothing stops."""
    write_panorama(panorama_of(covered=covered), str(path), OutputOptions(**options))
    data = path.read_bytes()
    path.unlink()
    return data


class Counting:
    """Makes tiles and counts them; the one after `most` fails."""

    def __init__(self, most=TILES):
        self.made, self.most = [], most

    def __call__(self, region):
        if len(self.made) == self.most:
            raise KeyboardInterrupt
        self.made.append(region)
        return computed(region)


def stopped(path, most=BEFORE_THE_KILL, **options):
    panorama = panorama_of(Counting(most), covered=options.pop("covered", False))
    with pytest.raises(KeyboardInterrupt), finished_tiles(str(path), "key", panorama) as finished:
        write_panorama(panorama, str(path), OutputOptions(**options), finished=finished)


SLOWLY = """
import os, sys, time
sys.path[:0] = {paths!r}
from test_partial import computed, write
def slowly(region):
    os.write(1, b"tile" + os.linesep.encode())
    time.sleep(0.05)
    return computed(region)
write({path!r}, slowly, compression="none")
"""


def test_a_run_that_was_killed_goes_on_to_the_same_bytes(tmp_path):
    path, tests = tmp_path / "a.tif", os.path.dirname(__file__)
    program = SLOWLY.format(paths=[tests, os.path.dirname(tests)], path=str(path))
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        for _ in range(BEFORE_THE_KILL):
            assert process.stdout.readline() == "tile\n"
        process.send_signal(signal.SIGKILL)
        assert process.wait(30) == -signal.SIGKILL
    assert os.listdir(tmp_path) == ["a.tif.partial"]

    rest = Counting()
    note = write(path, rest, compression="none")

    # two threads: what was begun last may be lost
    assert TILES - BEFORE_THE_KILL <= len(rest.made) <= TILES - BEFORE_THE_KILL + 2
    assert note == f"going on: {TILES - len(rest.made)} of {TILES} tiles are there"
    assert os.listdir(tmp_path) == ["a.tif"]
    assert path.read_bytes() == whole(tmp_path / "b.tif", compression="none")


@pytest.mark.parametrize("covered", [False, True])
@pytest.mark.parametrize(("name", "options"), [("a.tif", {"pyramid": "full"}), ("a.png", {}), ("a.jpg", {})])
def test_every_format_goes_on(name, options, covered, tmp_path):
    stopped(tmp_path / name, covered=covered, **options)
    rest = Counting()

    write(tmp_path / name, rest, covered=covered, **options)

    assert len(rest.made) == TILES - BEFORE_THE_KILL
    assert (tmp_path / name).read_bytes() == whole(tmp_path / f"b{name}", covered=covered, **options)


def test_what_lies_outside_the_pixels_may_change_between_the_runs(tmp_path):
    stopped(tmp_path / "a.jpg", quality=20)

    assert "going on" in write(tmp_path / "a.jpg", quality=80)
    assert (tmp_path / "a.jpg").read_bytes() == whole(tmp_path / "b.jpg", quality=80)


@pytest.mark.parametrize("change", [{"key": "other"}, {"covered": True}])
def test_tiles_of_something_else_are_not_taken(change, tmp_path):
    stopped(tmp_path / "a.png")
    rest = Counting()

    note = write(tmp_path / "a.png", rest, **change)

    assert note == "is of other photos or options: starting anew"
    assert len(rest.made) == TILES


@pytest.mark.parametrize("at", ["pixels", "checksum", "cut off"])
def test_a_damaged_tile_is_made_again(at, tmp_path):
    stopped(tmp_path / "a.png", most=1)
    partial = tmp_path / "a.png.partial"
    data = bytearray(partial.read_bytes())
    if at == "cut off":
        del data[-100:]
    else:
        data[-1 if at == "checksum" else -1000] ^= 1
    partial.write_bytes(data)
    rest = Counting()

    write(tmp_path / "a.png", rest)

    assert len(rest.made) == TILES
    assert (tmp_path / "a.png").read_bytes() == whole(tmp_path / "b.png")


def test_a_file_that_is_no_part_of_a_panorama_is_left_alone(tmp_path):
    (tmp_path / "a.png.partial").write_text("dear diary")

    with pytest.raises(OutputError, match=r"a\.png\.partial: is no part"):
        write(tmp_path / "a.png")

    assert (tmp_path / "a.png.partial").read_text() == "dear diary"


def test_a_run_that_fails_before_its_first_tile_leaves_nothing(tmp_path):
    with pytest.raises(LimitError):
        write(tmp_path / "a.png", max_memory="1M")

    assert not any(tmp_path.iterdir())


def test_the_key_changes_with_what_pixels_depend_on(save, rng):
    path = save("a.png", rng.integers(0, 256, (30, 40, 3), np.uint8))
    one = alignment_of([shifted((40, 30), 0, 0), shifted((40, 30), 20, 0)], model="affine")
    one = replace(one, photos=tuple(replace(photo, path=path) for photo in one.photos))
    keys = [fingerprint(one, Options.of(**options)) for options in ({}, {"quality": 5, "max_memory": "1G"})]
    assert keys[0] == keys[1]

    keys += [fingerprint(one, Options.of(**options)) for options in ({"scale": 0.5}, {"blender": "feather"})]
    keys.append(fingerprint(replace(one, cameras=(one.cameras[0], shifted((40, 30), 21, 0))), Options()))
    os.utime(path, ns=(0, 0))
    keys.append(fingerprint(one, Options()))

    assert len(set(keys)) == 5
