"""The `identify` command: derivatives from the simulated range of a run, or from the records of a flight test."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from indicial.cli.commands import Output, Verbose, app, perform

Source = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE", help="A flight test file (`.toml`); or a case file, or the folder of an earlier run."
    ),
]


@app.command(
    epilog="**Examples:** `indicial identify data/flight_tests/light_aircraft.toml`, "
    "`indicial identify runs/basic_finner_quick`"
)
def identify(source: Source, output: Output = None, verbose: Verbose = False) -> None:
    """Derivatives from flight records, or from the flight of a run.

    Of a flight test file, everything from the instruments' tables to derivatives with a verdict each: diagnosis,
    compatibility, equation error, output error; with figures and a report. Of a case, its stage `identify`: the flight
    is measured as a spark range does, with noise, and its derivatives are identified.
    """
    from indicial.reference_data import find_flight_test

    file = find_flight_test(source)
    if file is None:
        perform(source, output, None, verbose, ("identify",), resume=False)
        return
    import logging

    from indicial.cli.console import ConsoleReporter
    from indicial.cli.outputs import to_be_folder
    from indicial.pipeline.flight_test import reduce_flight_test
    from indicial.pipeline.flight_test_report import write_flight_test

    if verbose:
        logging.basicConfig(level=logging.INFO, format="%(asctime)s %(name)s: %(message)s")
    into = to_be_folder(Path("runs") / file.stem if output is None else Path(output), "--output")
    with ConsoleReporter() as reporter:
        result = reduce_flight_test(file, reporter)
        page = write_flight_test(result, into, reporter)
    typer.echo(result.summary())
    typer.echo(f"report: {page}")
