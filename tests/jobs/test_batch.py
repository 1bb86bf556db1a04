"""A batch goes on after failures, tells the code of each panorama, and overwrites nothing."""

import shutil
from contextlib import contextmanager

import cv2
import numpy as np
import pytest

from panostitch.errors import InputError
from panostitch.io.writers import write_picture
from panostitch.jobs.batch import Outcome, Setting, Task, batch_exit_code, find_tasks, run_batch
from panostitch.options import Options
from panostitch.runtime.executor import serial
from panostitch.runtime.trace import silent
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene


@pytest.fixture(scope="module")
def other_views():
    """Two photographs of another world that overlap by half."""
    scene = sphere_scene(procedural_texture(2400, 1200, seed=8))
    cameras = rig(np.deg2rad([0, 20]), size=(400, 300), hfov=np.deg2rad(50))
    return [photograph(scene, camera, supersample=1) for camera in cameras]


@pytest.fixture
def inbox(tmp_path, filled):
    """The folders of `filled`, for one test, and beside them one for the output."""
    (tmp_path / "out").mkdir()
    return shutil.copytree(filled, tmp_path / "inbox")


@pytest.fixture(scope="module")
def filled(tmp_path_factory, views, other_views):
    """Folders: good; broken (no picture in it can be read); mixed (two panoramas and a stranger); apart; empty."""
    rng = np.random.default_rng(0)
    noise = [rng.integers(0, 256, (300, 400, 3), np.uint8) for _ in range(2)]
    folders = {
        "apart": noise,
        "good": views[:2],
        "mixed": [*views[:3], *other_views, noise[0]],
    }
    root = tmp_path_factory.mktemp("filled")
    for name, pictures in folders.items():
        (root / name).mkdir(parents=True)
        for n, picture in enumerate(pictures):
            write_picture(str(root / name / f"{n}.png"), picture)
    (root / "broken").mkdir()
    for n in range(2):
        (root / "broken" / f"{n}.jpg").write_bytes(b"\xff\xd8\xff no picture")
    (root / "empty").mkdir()
    (root / ".hidden").mkdir()
    write_picture(str(root / ".hidden" / "0.png"), views[0])
    return root


def setting(output, *, overwrite=False, extension=".png", heard=None):
    @contextmanager
    def tracer(name):
        if heard is not None:
            heard.append(("open", name))
        yield silent
        if heard is not None:
            heard.append(("close", name))

    quick = Options.of(work_megapixels=0.12, max_features=600, retries="none")
    return Setting(str(output), extension, overwrite, quick, serial, tracer)


def run(inbox, output, **options):
    told = []
    outcomes = run_batch(find_tasks(str(inbox)), setting(output, **options), told.append)
    assert told == outcomes
    return {outcome.name: outcome for outcome in outcomes}


def test_folders_with_photos_become_tasks_in_natural_order(tmp_path, views):
    for name in ("b10", "b9", "a"):
        (tmp_path / name).mkdir()
        write_picture(str(tmp_path / name / "p.png"), views[0])
    (tmp_path / "empty").mkdir()
    write_picture(str(tmp_path / "own.png"), views[0])

    tasks = find_tasks(str(tmp_path))

    assert [task.name for task in tasks] == [tmp_path.name, "a", "b9", "b10"]
    assert all(len(task.photos) == 1 for task in tasks)


def of_folder(inbox, output, name, **options):
    tasks = [task for task in find_tasks(str(inbox)) if task.name == name]
    return run_batch(tasks, setting(output, **options), lambda _: None)


@pytest.mark.parametrize("name", ["missing", "empty"])
def test_no_folder_or_no_photos_is_an_input_error(tmp_path, name):
    (tmp_path / "empty").mkdir()

    with pytest.raises(InputError):
        find_tasks(str(tmp_path / name))


def test_a_batch_goes_on_after_failures(inbox, tmp_path):
    outcomes = run(inbox, tmp_path / "out")

    assert {name: outcome.exit_code for name, outcome in outcomes.items()} == {
        "apart": 4,
        "broken": 5,
        "good": 0,
        "mixed": 3,
        "mixed-2": 0,
    }
    assert batch_exit_code(list(outcomes.values())) == 10
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["good.png", "mixed-2.png", "mixed.png"]


@pytest.fixture
def mixed(inbox, tmp_path):
    return run_batch(
        [t for t in find_tasks(str(inbox)) if t.name == "mixed"], setting(tmp_path / "out"), lambda _: None
    )


def test_a_folder_of_two_panoramas_becomes_two_files(mixed, tmp_path):
    first, second = mixed

    assert (first.name, second.name) == ("mixed", "mixed-2")
    assert (first.photos, second.photos) == (3, 2)
    assert first.given == second.given == 6
    for outcome in mixed:
        written = cv2.imread(outcome.path)
        assert written.shape[1::-1] == outcome.size
        assert outcome.seconds > 0
    assert (tmp_path / "out" / "mixed-2.png").exists()


def test_what_belongs_to_neither_is_reported_once(mixed):
    first, second = mixed

    assert [photo.name for photo in first.left_out] == ["5.png"]
    assert second.left_out == ()
    assert first.exit_code == 3


def test_failures_say_why(inbox, tmp_path):
    (apart,) = of_folder(inbox, tmp_path / "out", "apart")

    assert (apart.message, apart.path, apart.photos) == ("no two photos overlap", "", 0)


def test_a_folder_of_one_photo_says_so(tmp_path, views):
    write_picture(str(tmp_path / "a.png"), views[0])

    (alone,) = run(tmp_path, tmp_path / "out").values()

    assert alone.exit_code == 5
    assert "a.png is the only photo" in alone.message


def test_a_folder_that_cannot_be_read_says_so(inbox, tmp_path):
    (broken,) = of_folder(inbox, tmp_path / "out", "broken")

    assert broken.exit_code == 5
    assert "0.jpg" in broken.message


def test_nothing_is_overwritten(inbox, tmp_path):
    existing = tmp_path / "out" / "mixed.png"
    existing.write_bytes(b"mine")

    first, second = of_folder(inbox, tmp_path / "out", "mixed")

    assert existing.read_bytes() == b"mine"
    assert first.exit_code == 8
    assert "exists" in first.message
    # what does not exist yet is made all the same
    assert second.exit_code == 0
    assert (tmp_path / "out" / "mixed-2.png").exists()


def test_unless_it_is_asked_for(inbox, tmp_path):
    existing = tmp_path / "out" / "good.png"
    existing.write_bytes(b"old")

    (outcome,) = of_folder(inbox, tmp_path / "out", "good", overwrite=True)

    assert outcome.exit_code == 0
    assert existing.read_bytes() != b"old"


def test_photos_that_cannot_be_read_are_left_out_of_the_others(inbox, tmp_path):
    (inbox / "good" / "2.jpg").write_bytes(b"\xff\xd8\xff no picture")

    (outcome,) = of_folder(inbox, tmp_path / "out", "good")

    assert (outcome.exit_code, outcome.photos, outcome.given) == (3, 2, 3)
    assert [photo.name for photo in outcome.left_out] == ["2.jpg"]


def test_each_panorama_has_its_trace_and_it_is_closed(inbox, tmp_path):
    heard = []

    tasks = [task for task in find_tasks(str(inbox)) if task.name in ("apart", "good")]
    run_batch(tasks, setting(tmp_path / "out", heard=heard), lambda _: None)

    assert ("open", "good") in heard
    assert ("close", "good") in heard
    assert ("open", "apart") in heard


@pytest.mark.parametrize(
    ("codes", "expected"),
    [((0, 0), 0), ((), 0), ((0, 3), 3), ((3, 4, 0), 10), ((7,), 10), ((0, 8), 10)],
)
def test_the_code_of_the_batch(codes, expected):
    assert batch_exit_code([Outcome("x", 2, 1.0, exit_code=code) for code in codes]) == expected


def test_two_folders_of_one_name_do_not_overwrite_each_other(inbox, tmp_path, views):
    # a panorama of the second group of `mixed` has the name of a folder
    (inbox / "mixed-2").mkdir()
    for n, view in enumerate(views[:2]):
        write_picture(str(inbox / "mixed-2" / f"{n}.png"), view)

    tasks = [task for task in find_tasks(str(inbox)) if task.name.startswith("mixed")]
    outcomes = run_batch(tasks, setting(tmp_path / "out"), lambda _: None)

    both = [outcome for outcome in outcomes if outcome.name == "mixed-2"]
    assert sorted(outcome.exit_code for outcome in both) == [0, 8]


def test_tasks_need_not_be_folders(views, tmp_path):
    paths = []
    for n, view in enumerate(views[:2]):
        paths.append(str(tmp_path / f"{n}.png"))
        write_picture(paths[-1], view)

    (outcome,) = run_batch([Task("two", tuple(paths))], setting(tmp_path), lambda _: None)

    assert (outcome.exit_code, outcome.photos) == (0, 2)
