"""The command line: the list of commands, and the one place where an error becomes an exit code."""

from __future__ import annotations

import os
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from r2s2r_cli import __version__
from r2s2r_cli.commands import COMMANDS, GROUPS
from r2s2r_cli.console import PipeClosed, print_error, tell
from r2s2r_cli.errors import DamageWarning, ExitCode, GateError, InputError, Interrupted, R2S2RError, UsageError

BUG_MESSAGE = "this is a bug in r2s2r, please report it with the lines above"


class ErrorGroup(TyperGroup):
    """Turns every outcome into an exit code of `errors.ExitCode`; tracebacks are for bugs only."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run; leave through SystemExit with one of our codes. No arguments: show the help."""
        del standalone_mode  # our own error handling replaces Typer's, which this flag would switch on
        _open_streams()
        arguments = list(sys.argv[1:] if args is None else args) or ["--help"]
        run = super().main
        code = run_guarded(
            lambda: run(arguments, prog_name, complete_var, False, windows_expand_args, **extra),
            "--json" in arguments,
            arguments,
        )
        sys.exit(code)


def run_guarded(call: Callable[[], object], as_json: bool, arguments: Sequence[str] = ()) -> int:
    """Run `call` and return its exit code; errors and warnings are printed in our form. arguments: as typed."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", DamageWarning)
        warnings.showwarning = _warner(warnings.showwarning)
        try:
            return _run_guarded(call, as_json, arguments)
        finally:
            _leave_streams()


def _warner(other: Callable[..., None]) -> Callable[..., None]:
    """Print our own warning as one line; leave those of libraries to `other`."""

    def show(message: Warning | str, category: type[Warning], *rest: Any, **options: Any) -> None:
        if issubclass(category, DamageWarning):
            print(f"warning: {message}", file=sys.stderr)
        else:
            other(message, category, *rest, **options)

    return show


def _run_guarded(call: Callable[[], object], as_json: bool, arguments: Sequence[str]) -> int:
    try:
        result = call()
        code = result if isinstance(result, int) else ExitCode.DONE
        if code == ExitCode.INTERRUPTED:  # Typer turns Ctrl-C into this code and says nothing
            raise KeyboardInterrupt
        sys.stdout.flush()
        return code
    except Interrupted as error:
        tell(f"interrupted: {error.what}\nhint: {error.hint}")
        return error.exit_code
    except R2S2RError as error:
        from r2s2r_cli.commands.whole import whole

        error.hint = whole(error, arguments)
        # A gate is judged on a result that was printed: stdout holds its document already.
        print_error(error, as_json=as_json and not isinstance(error, GateError))
        return error.exit_code
    except typer.TyperException as error:
        from r2s2r_cli.commands.parsing import usage_error

        said = usage_error(error, arguments)
        print_error(said, as_json=as_json)
        return said.exit_code
    except (KeyboardInterrupt, typer.Abort):
        tell("interrupted: nothing is half-written; run the command again")
        return ExitCode.INTERRUPTED
    except (PipeClosed, BrokenPipeError):
        return ExitCode.DONE
    except OSError as error:
        print_error(_system_error(error), as_json=as_json)
        return ExitCode.INPUT
    except UnicodeError as error:
        print_error(_text_error(error), as_json=as_json)
        return ExitCode.USAGE
    except Exception:
        traceback.print_exc()
        print(BUG_MESSAGE, file=sys.stderr)
        return ExitCode.BUG


def _leave_streams() -> None:
    """What a stream does not take goes nowhere: Python must not complain at its exit, nor change the exit code."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _system_error(error: OSError) -> InputError:
    """The operating system refused something that no command foresaw: a deleted directory, a forbidden one."""
    named = isinstance(error.filename, str | bytes)
    place = os.fsdecode(error.filename) if named else "the working directory"
    return InputError(
        "the system does not let r2s2r go on",
        where=place,
        expected="a file or directory it may use",
        received=error.strerror or str(error),
        hint="cd to the project, look at it with: ls -la",
    )


def _text_error(error: UnicodeError) -> UsageError:
    return UsageError("a name is not UTF-8 text", where="the command line", expected="UTF-8",
                      received=ascii(str(error))[:100], hint="rename it, then run the command again")  # fmt: skip


def _open_streams() -> None:
    """Streams that exist and take every character: `>&-` closes one, an ASCII locale refuses most."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - stays open to the end
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


app = typer.Typer(
    name="r2s2r",
    cls=ErrorGroup,
    help="Close the gap between a cable-driven robot and its simulator, and say what causes the rest.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _version(value: bool) -> None:
    if value:
        print(f"r2s2r {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    del version


for _name, _function in COMMANDS.items():
    app.command(_name, no_args_is_help=False)(_function)
for _name, _group in GROUPS.items():
    app.add_typer(_group, name=_name)
