"""The `flights` command: two trajectories side by side."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer

from indicial.cli.commands import app
from indicial.cli.outputs import FiguresFolder, JsonFile, to_file


class Align(enum.StrEnum):
    """What the flights are compared at."""

    TIME = "time"
    STATION = "station"


_FILE = "A trajectory's file: `.nc`, `.csv` or `.parquet`."


@app.command(
    epilog="**Example:** `indicial flights runs/basic_finner_quick/histories/flight_derivatives.nc "
    "runs/basic_finner_quick/histories/flight_rom.nc --align station --figures figures`"
)
def flights(
    first: Annotated[Path, typer.Argument(metavar="A", help=_FILE)],
    second: Annotated[Path, typer.Argument(metavar="B", help=_FILE)],
    align: Annotated[Align, typer.Option(help="Compare at the same times, or at the same stations x.")] = Align.TIME,
    json_file: JsonFile = None,
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", metavar="FILE", help="Write the differences at every instant.", callback=to_file),
    ] = None,
    figures: FiguresFolder = None,
) -> None:
    """Compare two flights: position, angles, swerve, phase, and the damping of both arms."""
    import json

    from indicial.errors import InputError
    from indicial.files import write_text
    from indicial.flightsim import Trajectory, compare

    one, other = Trajectory.load(first), Trajectory.load(second)
    try:
        found = compare(one, other, aligned=align.value)
    except InputError as error:
        # flights that do not oscillate have no arms to compare, and all else
        found = compare(one, other, aligned=align.value, arms=False)
        typer.echo(f"no damping is compared: {error}", err=True)
    for flight in (one, other):
        typer.echo(flight.summary())
    typer.echo(found.summary())
    if json_file is not None:
        write_text(json_file, json.dumps(found.to_dict(), indent=1))
        typer.echo(f"written: {json_file}")
    if csv_file is not None:
        found.to_csv(csv_file)
        typer.echo(f"written: {csv_file}")
    if figures is not None:
        from indicial.report.style import figure_style, save

        with figure_style():
            drawn = {"comparison": found.plot(), "path_first": one.plot_path(), "path_second": other.plot_path()}
            for name, figure in drawn.items():
                typer.echo(f"figure: {save(figure, figures / f'{name}.png')}")
