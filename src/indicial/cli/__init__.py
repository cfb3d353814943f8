"""The command line."""

from __future__ import annotations

import sys

from indicial.cli.commands import app
from indicial.errors import IndicialError, InputError

__all__ = ["app", "main"]


def main() -> None:
    """Run the command line: exit code 0 if all went well, 2 for bad input, 1 for a failure of the work itself."""
    try:
        app()
    except InputError as error:
        _fail(str(error), 2)
    except IndicialError as error:
        _fail(str(error), 1)
    except OSError as error:
        if error.filename is None:
            raise
        _fail(f"{error.filename}: {error.strerror}", 1)


def _fail(message: str, code: int) -> None:
    sys.stderr.write(f"indicial: {' '.join(message.split())}\n")
    sys.exit(code)
