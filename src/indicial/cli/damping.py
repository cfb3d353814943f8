"""The `damping` command: modes, damping and its verdicts, of a run or of an aircraft file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from indicial.cli.commands import app
from indicial.cli.outputs import FiguresFolder, JsonFile

if TYPE_CHECKING:
    from indicial.flightsim import AircraftDamping, MissileDamping

Source = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE",
        help="A run folder (or its case file or `results.json`), or an aircraft file (`.toml`).",
    ),
]
Roll = Annotated[
    float | None, typer.Option("--roll-rate", help="Roll rate of a missile [deg/s]; the case's if not given.")
]
Mach = Annotated[
    float | None, typer.Option(help="Mach number; the source's if not given. Derivatives stay as they are.")
]
Altitude = Annotated[
    float | None,
    typer.Option(help="Geometric altitude in the standard atmosphere [m]; the source's air if not given."),
]


@app.command(
    epilog="**Examples:** `indicial damping runs/basic_finner_quick --roll-rate 3600`, "
    "`indicial damping data/aircraft/boeing_747.toml --json 747.json --figures figures`"
)
def damping(
    source: Source,
    roll_rate: Roll = None,
    mach: Mach = None,
    altitude: Altitude = None,
    json_file: JsonFile = None,
    figures: FiguresFolder = None,
) -> None:
    """Modes and their damping: linear model, decay of a flight, closed form; what it is made of; and a verdict.

    Of a run, the missile's two arms: dynamic stability with or without roll, and what the reduced-order model changes
    over the reduced frequency. Of an aircraft file, all modes with their levels of MIL-F-8785C.
    """
    import json

    from indicial.files import write_text

    found = _found(source, roll_rate, mach, altitude)
    typer.echo(found.summary())
    if json_file is not None:
        write_text(json_file, json.dumps(found.to_dict(), indent=1, allow_nan=False))
        typer.echo(f"written: {json_file}")
    if figures is not None:
        from indicial.report.style import figure_style, save

        with figure_style():
            for name, figure in found.plot().items():
                typer.echo(f"figure: {save(figure, figures / f'{name}.png')}")


def _found(
    source: str, roll_rate: float | None, mach: float | None, altitude: float | None
) -> AircraftDamping | MissileDamping:
    import math

    from indicial.errors import InputError
    from indicial.pipeline.damping import damping_of_aircraft, damping_of_run
    from indicial.reference_data import find_aircraft

    for name, value in (("--mach", mach), ("--altitude", altitude), ("--roll-rate", roll_rate)):
        if value is not None and not math.isfinite(value):
            raise InputError(f"{name} is {value}, must be finite")
    file = find_aircraft(source)
    if file is not None:
        if roll_rate is not None:
            raise InputError("--roll-rate is for missiles: an aircraft file is of a flight that does not roll")
        return damping_of_aircraft(file, mach=mach, altitude=altitude)
    _exists(source)
    rate = None if roll_rate is None else math.radians(roll_rate)
    return damping_of_run(source, roll_rate=rate, mach=mach, altitude=altitude)


def _exists(source: str) -> None:
    """Refuse what is neither on disk nor packaged, naming the packaged cases and aircraft."""
    from indicial.errors import InputError
    from indicial.reference_data import data_folder, find_case

    if Path(source).exists() or not source.strip():
        return
    try:
        find_case(source)
    except InputError as error:
        known = ", ".join(sorted(item.name for item in (data_folder() / "aircraft").iterdir()))
        raise InputError(f"{error}; packaged aircraft: {known}") from None
