"""The command line."""

from __future__ import annotations

import sys
from typing import Any

import typer

from indicial.cli import damping as _damping  # noqa: F401  (they add their commands to the app)
from indicial.cli import flights as _flights  # noqa: F401
from indicial.cli import identify as _identify  # noqa: F401
from indicial.cli import rom as _rom  # noqa: F401
from indicial.cli import rom_files as _rom_files  # noqa: F401
from indicial.cli import study as _study  # noqa: F401
from indicial.cli.commands import app
from indicial.errors import IndicialError, InputError

__all__ = ["app", "main"]

# What the command line's own parser raises; typer exports only its descendants.
_UsageError: Any = typer.BadParameter.__base__


def main() -> None:
    """Run the command line: exit code 0 if all went well, 2 for bad input, 1 for a failure of the work itself."""
    try:
        # By itself typer draws a box of several lines round a wrong option.
        sys.exit(app(standalone_mode=False, prog_name="indicial"))
    except _UsageError as error:
        message = error.format_message()
        # `rom stage` is what `rom` does with a case: nobody types it
        hint = f" (see {error.ctx.command_path.removesuffix(' stage')} --help)" if message and error.ctx else ""
        _fail(f"{message}{hint}", error.exit_code)
    except typer.Abort as error:
        # The parser takes an unexpected end of file for a closed terminal.
        if isinstance(error.__cause__, EOFError):
            _fail("a file of the run is empty or cut short; give the same command to a new run folder", 2)
        _fail("interrupted", 130)
    except InputError as error:
        _fail(str(error), 2)
    except IndicialError as error:
        _fail(str(error), 1)
    except OSError as error:
        if error.filename is None:
            raise
        _fail(f"{error.filename}: {error.strerror}", 1)


def _fail(message: str, code: int) -> None:
    if message:
        sys.stderr.write(f"indicial: {' '.join(message.split())}\n")
    sys.exit(code)
