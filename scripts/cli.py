"""The console command `palpate`.

Nothing heavy is imported here or at the top of a command's module: numpy, MuJoCo and numba come in
when a command runs, so that `palpate --help` answers at once.
"""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from .commands.benchmark import benchmark
from .commands.episode import episode
from .commands.library import library
from .commands.prepare import prepare
from .commands.recognize import recognize
from .commands.report import report
from .commands.reproduce import reproduce
from .commands.suggest import suggest
from .commands.view import view
from .first_use import tell_first_use

__all__ = ["app", "main"]

app = typer.Typer(
    name="palpate",
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,  # a bug shows Python's own traceback
    rich_markup_mode="rich",
)
app.command()(episode)
app.command()(recognize)
app.command()(suggest)
app.command()(view)
app.command()(library)
app.command()(benchmark)
app.command()(report)
app.command()(reproduce)
app.command()(prepare)

NEEDS_KERNELS = ("episode", "recognize", "suggest", "view", "library", "benchmark", "reproduce")
"""Commands that wait for palpate to compile itself when it is first used."""
BAD_INPUT = 2
INTERRUPTED = 130


def main() -> None:
    """Run the command line and exit.

    What the caller got wrong (a flag, a file, a value) is one line on stderr and exit code 2;
    Ctrl-C is one line and 130. Anything else that goes wrong is a bug and keeps its traceback.
    """
    import warnings

    warnings.showwarning = tell
    try:
        code = app(standalone_mode=False)
    except (typer.TyperException, ValueError, OSError) as mistake:
        code = complain(mistake)
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    if code == INTERRUPTED:
        print("palpate: interrupted", file=sys.stderr)
    sys.exit(code)


def tell(message: Warning | str, *_: object, **__: object) -> None:
    """Print a warning as one line on stderr, without the source line that raised it."""
    print("palpate:", " ".join(str(message).split()), file=sys.stderr)


def complain(mistake: Exception) -> int:
    """Print what is wrong as one line on stderr; the exit code that goes with it."""
    if isinstance(mistake, typer.TyperException):
        text = mistake.format_message()
    elif isinstance(mistake, OSError) and mistake.filename and mistake.strerror:
        text = f"{mistake.filename}: {mistake.strerror}"
    else:
        text = str(mistake) or type(mistake).__name__
    print("palpate:", " ".join(text.split()), file=sys.stderr)
    return BAD_INPUT


def show_version(wanted: bool) -> None:
    """Print the installed version and exit, if wanted."""
    if wanted:
        from importlib.metadata import version  # 10 ms that only this flag pays

        print(f"palpate {version('palpate')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def palpate(
    context: typer.Context,
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=show_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    """Recognise objects by touch: which one it is, where it lies, and where to touch next."""
    if context.invoked_subcommand is None:
        print(context.get_help())
    elif context.invoked_subcommand in NEEDS_KERNELS and not {"-h", "--help"} & set(sys.argv):
        tell_first_use()
