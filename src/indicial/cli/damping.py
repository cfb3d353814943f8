"""The `damping` command: modes, damping and its verdicts, of a run or of an aircraft file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from indicial.cli.commands import app
from indicial.cli.outputs import FiguresFolder, JsonFile

if TYPE_CHECKING:
    from indicial.flightsim import AircraftDamping, MissileDamping, ModeSweep

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
Machs = Annotated[
    str | None, typer.Option(metavar="FROM:TO:NUMBER", help="Modes over Mach numbers instead, at the altitudes.")
]
Altitudes = Annotated[
    str | None, typer.Option(metavar="FROM:TO:NUMBER", help="Altitudes of such a sweep [m]; 0 if not given.")
]


@app.command(
    epilog="**Examples:** `indicial damping runs/basic_finner_quick --roll-rate 3600`, "
    "`indicial damping data/aircraft/boeing_747.toml --json 747.json --figures figures`, "
    "`indicial damping boeing_747 --machs 0.6:0.9:7 --altitudes 9000:12000:3 --figures figures`"
)
def damping(
    source: Source,
    roll_rate: Roll = None,
    mach: Mach = None,
    altitude: Altitude = None,
    machs: Machs = None,
    altitudes: Altitudes = None,
    json_file: JsonFile = None,
    figures: FiguresFolder = None,
) -> None:
    """Modes and their damping: linear model, decay of a flight, closed form; what it is made of; and a verdict.

    Of a run, the missile's two arms: dynamic stability with or without roll, and what the reduced-order model changes
    over the reduced frequency. Of an aircraft file, all modes with their levels of MIL-F-8785C. With `--machs`, modes
    over the envelope, each followed by its shape, in the standard atmosphere.
    """
    import json

    from indicial.files import write_text

    found: AircraftDamping | MissileDamping | ModeSweep
    if machs is None and altitudes is None:
        found = _found(source, roll_rate, mach, altitude)
    else:
        found = _swept(source, roll_rate, mach, altitude, machs, altitudes)
    typer.echo(found.summary())
    if json_file is not None:
        write_text(json_file, json.dumps(found.to_dict(), indent=1, allow_nan=False))
        typer.echo(f"written: {json_file}")
    if figures is not None:
        from indicial.report.style import figure_style, save

        with figure_style():
            drawn = found.plot()
            for name, figure in drawn.items() if isinstance(drawn, dict) else [("modes", drawn)]:
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
        _no_roll(roll_rate)
        return damping_of_aircraft(file, mach=mach, altitude=altitude)
    _exists(source)
    rate = None if roll_rate is None else math.radians(roll_rate)
    return damping_of_run(source, roll_rate=rate, mach=mach, altitude=altitude)


def _swept(
    source: str,
    roll_rate: float | None,
    mach: float | None,
    altitude: float | None,
    machs: str | None,
    altitudes: str | None,
) -> ModeSweep:
    import math

    from indicial.errors import InputError
    from indicial.pipeline.damping import sweep_of_aircraft, sweep_of_run
    from indicial.reference_data import find_aircraft

    if mach is not None or altitude is not None:
        raise InputError("--mach and --altitude are of one flight, --machs and --altitudes of a sweep: give either")
    if machs is None:
        raise InputError("--altitudes needs --machs, FROM:TO:NUMBER")
    over, heights = _values("--machs", machs), [0.0] if altitudes is None else _values("--altitudes", altitudes)
    file = find_aircraft(source)
    if file is not None:
        _no_roll(roll_rate)
        return sweep_of_aircraft(file, over, heights)
    _exists(source)
    return sweep_of_run(source, over, heights, roll_rate=None if roll_rate is None else math.radians(roll_rate))


def _values(option: str, text: str) -> list[float]:
    """Evenly spread numbers, as in 0.6:0.9:7."""
    import numpy as np

    from indicial.errors import InputError

    try:
        first, last, number = text.split(":")
        made = np.linspace(float(first), float(last), int(number))
    except ValueError:
        raise InputError(f"{option} is {text!r}, must be FROM:TO:NUMBER, such as 0.6:0.9:7") from None
    if not (1 <= made.size <= 1000 and np.all(np.isfinite(made))):
        raise InputError(f"{option} is {text!r}, must be of 1 to 1000 finite numbers")
    return [float(x) for x in made]


def _no_roll(roll_rate: float | None) -> None:
    from indicial.errors import InputError

    if roll_rate is not None:
        raise InputError("--roll-rate is for missiles: an aircraft file is of a flight that does not roll")


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
