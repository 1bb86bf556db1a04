"""The doctor finds planted faults, names the cure, and looks at the rest all the same."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from panostitch import features
from panostitch.cli.session import executor
from panostitch.jobs import doctor, selftest
from panostitch.jobs.doctor import machine, packages, trials
from panostitch.runtime import machine as limits
from panostitch.runtime.executor import Executor


def by_name(checks):
    return {check.name: check for check in checks}


def broken_module(folder, name, program):
    """A package of this name that is found first and does what it is told instead of being loaded."""
    (folder / name).mkdir()
    (folder / name / "__init__.py").write_text(program)


@pytest.fixture
def planted(tmp_path, monkeypatch):
    """Plant a package that is broken, for the processes in which the doctor loads packages."""

    def plant(name, program):
        broken_module(tmp_path, name, program)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    return plant


def package(name):
    """What is found of one package alone; others take time."""
    (requirement,) = (requirement for requirement in packages.needed() if requirement.name == name)
    return packages._package(requirement)


@pytest.fixture
def installed(monkeypatch):
    """Say that other versions are installed than are, None for not installed; and that all can be loaded."""
    healthy = packages._version
    monkeypatch.setattr(packages, "_load", lambda _: ("", ""))

    def pretend(**versions):
        there = {name.replace("_", "-"): version for name, version in versions.items()}
        monkeypatch.setattr(packages, "_version", lambda name: there[name] if name in there else healthy(name))

    return pretend


def test_a_healthy_installation_passes():
    checks = by_name(packages.packages())

    assert {check.verdict for check in checks.values()} <= {"ok", "note"}
    assert {"Python", "panostitch", packages.OPENCV, "numpy", "pillow"} <= checks.keys()


def test_a_display_library_is_missing(planted):
    planted("cv2", 'raise ImportError("libGL.so.1: cannot open shared object file: No such file or directory")')

    opencv = package(packages.OPENCV)

    assert opencv.verdict == "failed"
    assert "libGL.so.1" in opencv.found
    assert "with windows" in opencv.found
    assert f"pip uninstall -y {packages.OPENCV}" in opencv.remedy
    assert opencv.remedy.endswith(f"pip install {packages.OPENCV}")


def test_a_package_that_crashes(planted):
    planted("tifffile", f"import os; os.kill(os.getpid(), {int(signal.SIGILL)})")

    check = package("tifffile")

    assert check.verdict == "failed"
    assert "crashes" in check.found
    assert "--force-reinstall --no-deps tifffile" in check.remedy


def test_a_package_that_is_not_installed(installed):
    installed(tqdm=None)

    check = package("tqdm")

    assert (check.verdict, check.found) == ("failed", "not installed")
    assert "pip install 'tqdm>=" in check.remedy


def test_a_package_that_is_too_old(installed):
    installed(scipy="1.2.0")

    check = package("scipy")

    assert check.verdict == "failed"
    assert "1.2.0" in check.found


def test_two_opencvs_are_noted_with_the_cure(installed):
    installed(opencv_python="4.9.0.80")

    (check,) = packages._opencvs()

    assert check.verdict == "note"
    assert f"{packages.OPENCV}, opencv-python are all installed" in check.found
    assert f"pip uninstall -y {packages.OPENCV} opencv-python" in check.remedy


def test_one_opencv_is_nothing_to_note():
    assert list(packages._opencvs()) == []


def test_an_opencv_that_was_overwritten(planted):
    planted("cv2", "__version__ = '4.5.1'")

    check = package(packages.OPENCV)

    assert check.verdict == "failed"
    assert "overwritten by an OpenCV 4.5.1" in check.found


def test_an_extra_that_is_missing_is_no_failure(installed):
    installed(ruff=None)

    check = by_name(packages.extras())["extra dev"]

    assert (check.verdict, check.found) == ("missing", "without ruff")
    assert "[dev]" in check.remedy


@pytest.mark.parametrize("there", [True, False])
def test_other_programs(there, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: name if there else None)

    for check in packages.programs():
        assert check.verdict == ("ok" if there else "missing")
        assert ("apt install hugin-tools" in check.remedy) == (not there)


def test_the_rest_is_looked_at_where_a_package_is_broken(monkeypatch):
    monkeypatch.setattr(packages, "packages", lambda: iter([doctor.Check("packages", "scipy", "failed", "too old")]))

    checks = list(doctor.examine(run=Executor()))

    verdicts = {check.part: check.verdict for check in checks}
    assert [verdicts[part] for part in doctor.PARTS] == ["not tried"] * 3
    assert "memory" in by_name(checks)


def test_a_package_that_nobody_told_of_is_missing(monkeypatch):
    """As after an update of the sources alone."""

    def fail(_):
        raise ModuleNotFoundError("No module named 'novelty'")
        yield

    monkeypatch.setattr(packages, "packages", lambda: iter(()))
    monkeypatch.setattr(doctor, "_trials", fail)
    check = by_name(doctor.examine(run=Executor()))["trials"]

    assert check.verdict == "failed"
    assert "novelty" in check.found
    assert check.remedy == packages.this_program()
    assert "pip install" in check.remedy


def test_every_format_and_every_detector_is_tried():
    checks = by_name([*trials.formats(), *trials.detectors()])

    assert {check.verdict for check in checks.values()} == {"ok"}
    assert checks.keys() >= {"JPEG, 8 bits", "PNG, 16 bits", "TIFF, 16 bits", "WEBP, 8 bits", "JPEG2000, 8 bits"}
    assert checks.keys() >= set(features.DETECTORS)


def test_a_format_that_is_written_wrongly(monkeypatch):
    healthy = trials.write_panorama

    def shifted(panorama, path, options):
        wrong = trials._ramps(panorama.plan.crop)
        np.subtract(wrong.pixels, 4 if path.endswith(".png") else 0, out=wrong.pixels)
        healthy(trials.replace(panorama, read=lambda _: wrong), path, options)

    monkeypatch.setattr(trials, "write_panorama", shifted)
    checks = by_name(trials.formats())

    assert checks["PNG, 8 bits"].verdict == "failed"
    assert "4 grey levels off" in checks["PNG, 8 bits"].found
    assert checks["TIFF, 8 bits"].verdict == "ok"


def test_a_detector_that_raises(monkeypatch):
    def fail(*_):
        raise RuntimeError("no AKAZE in this OpenCV")

    monkeypatch.setattr(trials, "DETECTORS", {"akaze": fail, "orb": features.DETECTORS["orb"]})
    checks = by_name(trials.detectors())

    assert checks["akaze"].verdict == "failed"
    assert "no AKAZE" in checks["akaze"].found
    assert checks["orb"].verdict == "ok"


@pytest.fixture
def _smaller(monkeypatch):
    """Smaller photos of a smaller world, for speed."""
    monkeypatch.setattr(selftest, "TEXTURES", (1024, 1024))
    monkeypatch.setattr(trials, "QUICK_SIZE", (400, 300))


@pytest.mark.usefixtures("_smaller")
def test_a_scene_that_is_stitched_wrongly(monkeypatch):
    healthy = trials.assemble

    def brighter(panorama, *, run):
        pixels, mask = healthy(panorama, run=run)
        return np.where(pixels < 250, pixels + 5, pixels), mask

    monkeypatch.setattr(trials, "assemble", brighter)
    checks = by_name(trials.scene(Executor(2)))

    assert checks["cameras"].verdict == "ok"
    assert checks["panorama"].verdict == "failed"


@pytest.mark.parametrize("version", [1, 2])
def test_limits_of_containers(version, tmp_path, monkeypatch):
    """The group's own limits, and those of the groups around it; the smallest counts."""
    own = tmp_path / "own"
    cpu, mem = (
        tmp_path / name / "outer/inner" if version == 1 else tmp_path / "outer/inner" for name in ("cpu", "memory")
    )
    cpu.mkdir(parents=True)
    mem.mkdir(parents=True, exist_ok=True)
    if version == 1:
        own.write_text("4:memory:/outer/inner\n1:cpu,cpuacct:/outer/inner\n")
        (cpu / "cpu.cfs_quota_us").write_text("-1\n")
        (cpu.parent / "cpu.cfs_quota_us").write_text("150000\n")
        (cpu.parent / "cpu.cfs_period_us").write_text("100000\n")
        (mem / "memory.limit_in_bytes").write_text("9223372036854771712\n")
        (mem.parent / "memory.limit_in_bytes").write_text("1073741824\n")
    else:
        own.write_text("0::/outer/inner\n")
        (cpu / "cpu.max").write_text("max 100000\n")
        (cpu.parent / "cpu.max").write_text("150000 100000\n")
        (mem / "memory.max").write_text("max\n")
        (mem.parent / "memory.max").write_text("1073741824\n")
    monkeypatch.setattr(limits, "CGROUPS", tmp_path)
    monkeypatch.setattr(limits, "OWN_GROUPS", own)

    assert limits.processor_quota() == 1.5
    assert limits.memory_limit() == 1 << 30


def test_no_container_no_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "OWN_GROUPS", tmp_path / "none")

    assert limits.processor_quota() is None
    assert limits.memory_limit() is None


def test_little_time_and_memory_are_said(monkeypatch):
    monkeypatch.setattr(limits, "processors", lambda: 8)
    monkeypatch.setattr(limits, "processor_quota", lambda: 2.5)
    monkeypatch.setattr(limits, "memory_limit", lambda: 512 << 20)
    checks = by_name(machine.system())

    assert (checks["processors"].verdict, checks["processors"].value) == ("ok", 2)
    assert "time of 2.5 of them" in checks["processors"].found
    assert (checks["memory"].verdict, checks["memory"].remedy) == ("note", "use --max-memory 384M")
    assert checks["memory"].value == 512 << 20


@pytest.mark.parametrize(("quota", "expected"), [(None, 8), (2.5, 2), (0.5, 1), (16.0, 8)])
def test_no_more_threads_than_there_is_time_for(quota, expected, monkeypatch):
    monkeypatch.setattr(limits, "processors", lambda: 8)
    monkeypatch.setattr(limits, "processor_quota", lambda: quota)

    assert executor({"threads": None, "quiet": True, "as_json": False}).threads == expected
    assert executor({"threads": 3, "quiet": True, "as_json": False}).threads == 3


def test_a_folder_that_cannot_be_written_to(monkeypatch):
    def fail(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr("tempfile.TemporaryFile", fail)
    checks = by_name(machine.system())

    assert checks["temporary folder"].verdict == "failed"
    assert "Read-only" in checks["temporary folder"].found
    assert "TMPDIR" in checks["temporary folder"].remedy
    assert checks["this folder"].verdict == "note"


def test_a_broken_opencv_is_said_by_every_command(tmp_path):
    """In a process of its own: in this one, OpenCV is loaded."""
    broken_module(tmp_path, "cv2", "raise ImportError('libGL.so.1: cannot open shared object file')")
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    call = [sys.executable, "-m", "panostitch"]

    stitch = subprocess.run(
        [*call, "a.jpg", "-o", "b.jpg"], env=environment, capture_output=True, text=True, check=False
    )
    asked = subprocess.run([*call, "doctor"], env=environment, capture_output=True, text=True, check=False)

    assert stitch.returncode == asked.returncode == 11
    assert "error: a part of the installation cannot be loaded: libGL.so.1" in stitch.stderr
    assert "panostitch doctor" in stitch.stderr
    assert "FAILED" in asked.stdout
    assert "not tried" in asked.stdout
    assert asked.stderr == ""
