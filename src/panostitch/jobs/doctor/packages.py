"""What is installed: each package that is needed, whether it can be loaded, and what is optional.

Nothing is believed that is written down: each package is loaded in a process of its own, which may crash.
"""

import json
import platform
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from urllib.parse import unquote, urlsplit

from packaging.requirements import Requirement

from panostitch.jobs.doctor.check import Check

NAME = "panostitch"
PACKAGES, EXTRAS = "packages", "optional"
# Modules that are not called like what brings them.
MODULES = {"opencv-contrib-python-headless": "cv2", "scikit-image": "skimage", "pillow": "PIL"}
OPENCV = "opencv-contrib-python-headless"
# All of them install the same folder `cv2`: each overwrites the others, and removing one breaks those that stay.
OPENCVS = (OPENCV, "opencv-python-headless", "opencv-contrib-python", "opencv-python")
RENDERERS = ("nona", "enblend")
HUGIN_INSTALL = "Debian, Ubuntu: sudo apt install hugin-tools enblend; else https://hugin.sourceforge.io"
TIMEOUT = 60  # s, for loading one package
# What the messages of failed imports mean; the first that is found counts.
CAUSES = {
    r"lib(GL|EGL|gthread|SM|Xext|Xrender)[-.\d]*\.so": "an OpenCV with windows, which this system has not",
    r"_ARRAY_API|numpy\.core\.multiarray|compiled using NumPy 1": "it was built for another NumPy",
    r"GLIBC": "it was built for a newer system",
}
LONGEST = 200  # characters of what is said of a failed import


def packages() -> Iterator[Check]:
    """Python, this program, and every package that it needs."""
    yield Check(
        PACKAGES, "Python", "ok", f"{platform.python_version()} ({sys.executable})", value=platform.python_version()
    )
    try:
        own = metadata.version(NAME)
    except metadata.PackageNotFoundError:
        yield Check(PACKAGES, NAME, "note", "run from its sources, not installed: packages are not looked at", pip("."))
        return
    yield Check(PACKAGES, NAME, "ok", own, value=own)
    for requirement in needed():
        yield _package(requirement)
    yield from _opencvs()


def needed(extra: str = "") -> list[Requirement]:
    """What this program, or one of its extras, requires on this system."""
    every = [Requirement(text) for text in metadata.requires(NAME) or ()]
    base = [r for r in every if not r.marker or r.marker.evaluate({"extra": ""})]
    return [r for r in every if r not in base and r.marker and r.marker.evaluate({"extra": extra})] if extra else base


def _package(requirement: Requirement) -> Check:
    name = requirement.name
    version = _version(name)
    if version is None:
        return Check(PACKAGES, name, "failed", "not installed", pip(f"{name}{requirement.specifier}"))
    loaded, failure = _load(MODULES.get(name, name.replace("-", "_")))
    if failure:
        return Check(
            PACKAGES, name, "failed", f"{version} cannot be loaded: {_explained(failure)}", anew(name), version
        )
    if not requirement.specifier.contains(version, prereleases=True):
        older = f"{version}, {requirement.specifier} is needed"
        return Check(PACKAGES, name, "failed", older, pip(f"{name}{requirement.specifier}"), version)
    if name == OPENCV and not version.startswith(loaded):
        return Check(PACKAGES, name, "failed", f"{version} was overwritten by an OpenCV {loaded}", anew(name), version)
    return Check(PACKAGES, name, "ok", version, value=version)


def _opencvs() -> Iterator[Check]:
    found = [name for name in OPENCVS if _version(name) is not None]
    if len(found) > 1:
        yield Check(
            PACKAGES,
            "one OpenCV only",
            "note",
            f"{', '.join(found)} are all installed, and overwrite each other: the last one that was installed is used",
            anew(OPENCV),
        )


def anew(name: str) -> str:
    """The line that repairs a package; of OpenCV, all that share its folder have to go first."""
    if name != OPENCV:
        return pip("--force-reinstall", "--no-deps", name)
    there = [other for other in OPENCVS if _version(other) is not None]
    remove = shlex.join([sys.executable, "-m", "pip", "uninstall", "-y", *there])
    return f"{remove} && {pip(name)}"


def _load(module: str) -> tuple[str, str]:
    """The version of a module, and why it cannot be loaded; one of them is empty."""
    program = f"import {module}; print(getattr({module}, '__version__', ''))"
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", program],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "", f"it takes longer than {TIMEOUT} s"
    if done.returncode < 0:
        number = -done.returncode
        return "", f"it crashes ({signal.strsignal(number) or number})"
    if done.returncode:
        return "", (done.stderr.strip().splitlines() or ["it fails without a word"])[-1]
    return done.stdout.strip(), ""


def _explained(failure: str) -> str:
    cause = next((why for pattern, why in CAUSES.items() if re.search(pattern, failure)), "")
    words = failure if len(failure) <= LONGEST else failure[:LONGEST] + "..."
    return f"{words}: {cause}" if cause else words


def extras() -> Iterator[Check]:
    """What may be installed besides, by the names under which pip knows it."""
    try:
        names = metadata.metadata(NAME).get_all("Provides-Extra") or []
    except metadata.PackageNotFoundError:
        return
    for extra in names:
        absent = [r.name for r in needed(extra) if _version(r.name) is None]
        if absent:
            yield Check(EXTRAS, f"extra {extra}", "missing", f"without {', '.join(absent)}", this_program(extra))
        else:
            yield Check(EXTRAS, f"extra {extra}", "ok", f"{len(needed(extra))} packages")


def programs() -> Iterator[Check]:
    """Other programs that some commands use where they are installed."""
    from panostitch.jobs.hugin import TOOLS

    for names, use in ((TOOLS, "a rival in `selftest --full`"), (RENDERERS, "Hugin's way to render what --pto writes")):
        absent = [name for name in names if shutil.which(name) is None]
        if absent:
            yield Check(EXTRAS, f"{names[0]} ...", "missing", f"without {', '.join(absent)}: {use}", HUGIN_INSTALL)
        else:
            yield Check(EXTRAS, f"{names[0]} ...", "ok", f"{', '.join(names)}: {use}")


def pip(*arguments: str) -> str:
    """The line that installs something into the Python that runs now."""
    return shlex.join([sys.executable, "-m", "pip", "install", *arguments])


def this_program(extra: str = "") -> str:
    """The line that installs this program as it was installed, with what it needs, and an extra."""
    try:
        origin = json.loads(metadata.distribution(NAME).read_text("direct_url.json") or "{}")
    except (metadata.PackageNotFoundError, ValueError):
        origin = {}
    url, folder = urlsplit(origin.get("url", "")), origin.get("dir_info")
    name = NAME if folder is None or url.scheme != "file" else unquote(url.path)
    editable = ["--editable"] if folder and folder.get("editable") else []
    return pip(*editable, f"{name}[{extra}]" if extra else name)


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
