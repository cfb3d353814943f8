"""The figures of the study: the three flights over each other, and what they differ by."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.flightsim import Trajectory
from indicial.report.style import BLUE, GREEN, VERMILION, figure_style, save
from indicial.studies.freeflight.pieces import ANGLES, FLIGHTS
from indicial.studies.kept import Results
from indicial.studies.piece import PieceResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE = {"derivatives": (BLUE, "--"), "model": (GREEN, ":"), "flow": (VERMILION, "-")}
_LABEL = {"derivatives": "derivatives", "model": "state-space model", "flow": "flow solver in the loop"}


def draw(results: Results, folder: Path) -> tuple[Path, ...]:
    """Write all figures for which there are results."""
    paths = []
    with figure_style() as plt:
        for angle in ANGLES:
            shot = results.select(method=f"shot_{angle:g}deg").at(2.0)
            if shot is not None:
                paths.append(save(_flights(shot, plt), folder / f"shot_{angle:g}deg.png"))
    return tuple(paths)


def _flights(shot: PieceResult, plt: Any) -> Figure:
    figure: Figure
    figure, axes = plt.subplots(3, 1, figsize=(8.0, 8.0), sharex=True)
    flights = {name: Trajectory.load(shot.file(name)) for name in FLIGHTS}
    flow = flights["flow"]
    for name in ("flow", *FLIGHTS[:2]):
        colour, line = _STYLE[name]
        flight = flights[name]
        axes[0].plot(flight.position[:, 0], np.degrees(flight.alpha), line, color=colour, label=_LABEL[name])
        if name != "flow":
            end = min(flow.position[-1, 0], flight.position[-1, 0])
            stations = flow.position[flow.position[:, 0] <= end, 0]
            one, other = flow.at_stations(stations), flight.at_stations(stations)
            axes[1].plot(stations, np.degrees(other.alpha - one.alpha), line, color=colour, label=_LABEL[name])
            axes[2].plot(stations, 1e3 * (other.position[:, 2] - one.position[:, 2]), line, color=colour)
    axes[0].set_ylabel("angle of attack [deg]")
    axes[1].set_ylabel("less that in the flow [deg]")
    axes[2].set_ylabel("lower than in the flow [mm]")
    axes[2].set_xlabel("distance downrange [m]")
    axes[0].legend(fontsize=8, ncols=3)
    axes[1].legend(fontsize=8, ncols=2)
    return figure
