"""`panostitch`: the group of commands, and the one place where errors become exit codes.

Commands are loaded when they are called, so that `--help` does not wait for OpenCV.
"""

import importlib
import os
import sys
import tempfile
import traceback
from contextlib import suppress
from typing import Any

import click

from panostitch.cli.terminal import say_error
from panostitch.errors import EXIT_BUG, EXIT_DAMAGED, EXIT_INTERRUPTED, EXIT_PIPE, PanostitchError

# Name of a command: its module and one line of help.
COMMANDS = {
    "stitch": "Photos to a panorama; the word may be left out.",
    "align": "First half: photos to a project file with their cameras.",
    "render": "Second half: a project file to a panorama.",
    "batch": "A panorama of every sub-folder of a folder.",
    "compare": "The same photos by cv2.Stitcher or Hugin, and by panostitch, side by side.",
    "detectors": "All detectors and matchers on your photos, side by side.",
    "selftest": "Photograph known scenes and state the true error.",
    "doctor": "Whether everything works here, and how to repair what does not.",
    "inspect": "What a panorama, a photo or a project file holds.",
}
DEFAULT = "stitch"
EXAMPLE = """\b
panostitch a.jpg b.jpg -o out.jpg        the panorama of two photos
panostitch photos/ -o out.jpg            of all photos in a folder
panostitch photos/ -o out.jpg --debug-dir why/   and a picture of every stage"""


class Commands(click.Group):
    """Loads commands lazily; what is no command's name begins the arguments of `stitch`."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        del ctx
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        del ctx
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"panostitch.cli.{cmd_name}").command
        return command

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and args[0] not in COMMANDS and args[0] not in ("--help", "-h", "--version"):
            args = [DEFAULT, *args]
        return super().parse_args(ctx, args)

    def format_usage(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        del ctx
        formatter.write_usage("panostitch", "PHOTOS... -o PANORAMA [OPTIONS]  |  COMMAND ...")

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))
        stitch = self.get_command(ctx, DEFAULT)
        if stitch:
            stitch.format_options(click.Context(stitch), formatter)


@click.group(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=f"{EXAMPLE}\n\nStitches overlapping photos into a panorama, through stages you can look into.",
)
@click.version_option(package_name="panostitch")
def cli() -> None:
    """The group itself does nothing."""


def main() -> None:
    """Run the command line and exit with the documented code."""
    # Photos, pairs and tiles run in threads of our own; a product or a filter that starts threads as well only waits
    # for them. The libraries read this when they are loaded, which is later.
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"):
        os.environ.setdefault(name, "1")
    code = run(sys.argv[1:])
    if code == EXIT_INTERRUPTED:
        # What was begun is cleared away. Threads may still be in native code, which Python would wait for, and which
        # aborts the process where a second Ctrl-C ends that wait.
        with suppress(OSError):
            sys.stdout.flush()
        os._exit(code)
    sys.exit(code)


def run(arguments: list[str]) -> int:
    """Run the command line on these arguments; the exit code. Errors are said, never raised."""
    try:
        code: Any = cli.main(arguments, prog_name="panostitch", standalone_mode=False)
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        click.echo("interrupted; no half-written panorama is left behind", err=True)
        return EXIT_INTERRUPTED
    except PanostitchError as error:
        say_error(error)
        return error.exit_code
    except ImportError as error:
        return _report_bug() if (error.name or "").startswith("panostitch") else _report_damage(error)
    except (BrokenPipeError, SystemExit):
        # The reader of our output went away: nobody is left to tell. Click makes an exit of it, and of nothing else.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_PIPE
    except Exception:
        return _report_bug()
    return int(code or 0)


def _report_damage(error: ImportError) -> int:
    click.echo(f"error: a part of the installation cannot be loaded: {error}", err=True)
    click.echo("  next: `panostitch doctor` says which, and how to repair it", err=True)
    return EXIT_DAMAGED


def _report_bug() -> int:
    with tempfile.NamedTemporaryFile("w", prefix="panostitch-", suffix=".log", delete=False) as log:
        log.write(traceback.format_exc())
    click.echo(f"error: this is a bug in panostitch; what happened is in {log.name}", err=True)
    click.echo("  next: report it, with that file and the command you gave", err=True)
    return EXIT_BUG
