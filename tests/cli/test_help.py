"""`--help` is quick, begins with an example, and tells every option with the default that it has."""

import dataclasses
import re
import subprocess
import sys
from typing import Literal, get_args, get_origin

import click
import pytest

from panostitch.cli.main import COMMANDS
from panostitch.compositing.blend import BLENDERS
from panostitch.compositing.exposure import EXPOSURE
from panostitch.compositing.seams import SEAMS
from panostitch.features import DETECTORS
from panostitch.geometry.projections import PROJECTIONS
from panostitch.matching import MATCHERS
from panostitch.options import (
    AlignmentOptions,
    CompositingOptions,
    FeatureOptions,
    LayoutOptions,
    MatchingOptions,
    Options,
    OutputOptions,
)

STAGES = [part.type for part in dataclasses.fields(Options)]
FIELDS = [(stage, field) for stage in STAGES for field in dataclasses.fields(stage)]
IDS = [field.name for _, field in FIELDS]

# The stages whose options a command takes.
TAKES = {
    "stitch": set(STAGES),
    "align": {FeatureOptions, MatchingOptions, AlignmentOptions},
    "render": {LayoutOptions, CompositingOptions, OutputOptions},
}

# The registry that an option chooses from, and what it may say besides.
REGISTRIES = {
    "detector": (DETECTORS, set()),
    "matcher": (MATCHERS, {"auto"}),
    "seams": (SEAMS, set()),
    "blender": (BLENDERS, set()),
    "exposure": (EXPOSURE, set()),
    "projection": (PROJECTIONS, {"auto", "little-planet"}),
}

# Modules that take long to import; `--help` needs none of them.
HEAVY = ("cv2", "numpy", "scipy", "skimage", "PIL")


def squeezed(text):
    return " ".join(text.split())


@pytest.fixture
def help_of(call):
    def ask(*arguments):
        result = call(*arguments, "--help")
        assert result.code == 0
        assert result.err == ""
        return result.out

    return ask


def entry(text, name):
    """What the help says of an option, up to the next one."""
    found = re.search(rf"--{name.replace('_', '-')} (?:(?! --?[a-z]).)*", squeezed(text))
    assert found, f"--{name} is not in the help"
    return found.group()


@pytest.mark.parametrize("arguments", [[], *([name] for name in COMMANDS)])
def test_help_does_not_wait_for_large_libraries(arguments):
    program = (
        "import sys; from panostitch.cli.main import run; code = run(sys.argv[1:]);"
        f"print([m for m in {HEAVY} if m in sys.modules], file=sys.stderr); sys.exit(code)"
    )

    done = subprocess.run(
        [sys.executable, "-c", program, *arguments, "--help"], capture_output=True, text=True, check=True
    )

    assert done.stderr == "[]\n"
    assert "Usage:" in done.stdout


def test_the_example_comes_first(help_of):
    lines = [line.strip() for line in help_of().splitlines() if line.strip()]

    assert lines[0].startswith("Usage:")
    assert lines[1].startswith("panostitch a.jpg b.jpg -o out.jpg")


def test_every_command_is_told(help_of):
    text = help_of()

    for name, line in COMMANDS.items():
        assert squeezed(f"{name} {line}") in squeezed(text)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_can_be_asked(name, help_of):
    assert name in help_of(name).splitlines()[0]


@pytest.mark.parametrize(("stage", "field"), FIELDS, ids=IDS)
def test_every_option_is_told_with_its_default(stage, field, help_of):
    for arguments in ([], *([name] for name in TAKES if stage in TAKES[name])):
        told = re.sub(r"(?<=\w)- ", "-", entry(help_of(*arguments), field.name))  # lines may end at a hyphen
        assert squeezed(field.metadata["help"]) in told
        default = re.search(r"\[default: ([^;\]]*)", told)
        assert (default and default[1].strip()) == (None if field.default is None else str(field.default))
        if field.metadata["min"] is not None:
            assert f"{field.metadata['min']}<=x<={field.metadata['max']}" in told
        if get_origin(field.type) is Literal:
            choices = get_args(field.type)
            assert f"[{'|'.join(choices)}]" in told or f"One of: {', '.join(choices)}." in told


@pytest.mark.parametrize(("stage", "field"), FIELDS, ids=IDS)
def test_commands_take_the_options_of_their_stages_only(stage, field, call):
    flag = "--" + field.name.replace("_", "-")
    for name in TAKES:
        assert (f" {flag} " in call(name, "--help").out) == (stage in TAKES[name])


def test_defaults_are_within_their_ranges():
    for _, field in FIELDS:
        if field.metadata["min"] is not None and field.default is not None:
            assert field.metadata["min"] <= field.default <= field.metadata["max"], field.name
        if get_origin(field.type) is Literal:
            assert field.default in get_args(field.type), field.name


def test_option_names_are_unique_over_stages():
    assert len(set(IDS)) == len(IDS)


def test_options_from_flat_names():
    for stage, field in FIELDS:
        chosen = Options.of(**{field.name: "chosen"})
        home = next(part for part in vars(chosen).values() if isinstance(part, stage))
        assert getattr(home, field.name) == "chosen"
    assert Options.of() == Options()


def test_an_unknown_name_is_refused():
    with pytest.raises(TypeError, match="detctor"):
        Options.of(detctor="sift", ratio=0.7)


@pytest.mark.parametrize("name", REGISTRIES)
def test_choices_are_the_entries_of_the_registry(name):
    registry, more = REGISTRIES[name]
    (field,) = (field for _, field in FIELDS if field.name == name)

    assert set(get_args(field.type)) == set(registry) | more


def test_version(call):
    result = call("--version")

    assert result.code == 0
    assert re.search(r"\d+\.\d+", result.out)


def test_help_fits_the_terminal(help_of, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")

    for line in click.unstyle(help_of()).splitlines():
        assert len(line) <= 80, line
