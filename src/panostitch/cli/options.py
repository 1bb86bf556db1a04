"""Dataclasses of options become click options: their names, defaults, ranges and help come from there."""

import dataclasses
import math
from collections.abc import Callable
from types import UnionType
from typing import Any, Literal, get_args, get_origin

import click

from panostitch.options import Options

Command = Callable[..., Any]

LONGEST_CHOICES = 60  # characters that fit a terminal beside the option's name; longer lists stand in its help


def every_stage(command: Command) -> Command:
    """Decorate a command with the options of all stages."""
    return stage_options(*(type(part.default) for part in dataclasses.fields(Options)))(command)


class FiniteRange(click.FloatRange):
    """A range that "nan", which compares with nothing, does not slip through."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a number.", param, ctx)
        return number


def stage_options(*stages: type) -> Callable[[Command], Command]:
    """Decorate a command with all options of some stages, in their order."""

    def decorate(command: Command) -> Command:
        for stage in reversed(stages):
            for field in reversed(dataclasses.fields(stage)):
                command = _click_option(field)(command)
        return command

    return decorate


def _click_option(field: "dataclasses.Field[Any]") -> Callable[[Command], Command]:
    name = "--" + field.name.replace("_", "-")
    kind: Any = field.type
    text, metavar = field.metadata["help"], None
    low, high = field.metadata["min"], field.metadata["max"]
    if isinstance(kind, UnionType):  # a value or None
        kind = next(choice for choice in get_args(kind) if choice is not type(None))
    if get_origin(kind) is Literal:
        kind = click.Choice([str(choice) for choice in get_args(kind)])
        if len("|".join(kind.choices)) > LONGEST_CHOICES:
            text, metavar = f"{text} One of: {', '.join(kind.choices)}.", "NAME"
    elif kind in (int, float) and low is not None:
        kind = (click.IntRange if kind is int else FiniteRange)(low, high)
    return click.option(name, type=kind, metavar=metavar, default=field.default, show_default=True, help=text)


def run_options(command: Command) -> Command:
    """Options of every command that works on photos: how it runs and what it says."""
    for decorate in (
        click.option("-v", "--verbose", count=True, help="Say more: every photo and every link."),
        click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors."),
        click.option("--json", "as_json", is_flag=True, help="The result as JSON on standard output."),
        click.option(
            "--threads",
            type=click.IntRange(1, 256),
            default=None,
            help="Threads at work.  [default: as many as there are processors, or as a container gives time for]",
        ),
        click.option("--overwrite", is_flag=True, help="Replace what is there already."),
        click.option(
            "--debug-dir", type=click.Path(), default=None, help="A picture of every stage, and metrics.json, go there."
        ),
    ):
        command = decorate(command)
    return command


report_option = click.option(
    "--report",
    metavar="FILE.html",
    default=None,
    help="Show what became of the photos, and why, in one page.",
)


def inclusion_options(*, exclude: bool = True) -> Callable[[Command], Command]:
    """Decorate a command with what it does where not every photo is in the panorama."""

    def decorate(command: Command) -> Command:
        if exclude:
            command = click.option(
                "--exclude", multiple=True, metavar="NAME", help="Leave this photo out, by its file name; repeatable."
            )(command)
        command = click.option(
            "--allow-partial",
            is_flag=True,
            help="Exit with 0 although photos were left out; they are named all the same.",
        )(command)
        return click.option("--require-all", is_flag=True, help="Write nothing unless every photo is in the panorama.")(
            command
        )

    return decorate


def options_of(given: dict[str, Any]) -> Options:
    """The Options among the parameters of a command; others are left where they are. Raises UsageError."""
    names = {f.name for part in dataclasses.fields(Options) for f in dataclasses.fields(part.default)}  # type: ignore[arg-type]
    options = Options.of(**{name: given[name] for name in names & given.keys()})
    options.check()  # before anything is done
    return options
