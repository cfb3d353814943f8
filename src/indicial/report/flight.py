"""Figures of flights: angles, path, angular motion, damping."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.conventions import Array
from indicial.flightsim import Trajectory
from indicial.identification import RangeRecord
from indicial.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, figure_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LABELS = {"derivatives": "derivative model", "rom": "state-space model in the loop"}
_CHANNEL_COLOURS = (BLACK, BLUE, ORANGE, GREEN, PURPLE, VERMILION)
_STYLES = {"derivatives": (BLUE, "-"), "rom": (VERMILION, "--")}


def flight_figure(flights: Mapping[str, Trajectory]) -> Figure:
    """Angle of attack, path and Mach number along the range."""
    with figure_style() as plt:
        figure: Figure
        figure, axes = plt.subplots(3, 1, figsize=(8.6, 7.6), sharex=True)
        for name, flight in flights.items():
            colour, line = _STYLES[name]
            x = flight.position[:, 0]
            axes[0].plot(x, np.degrees(flight.alpha), line, color=colour, lw=1.0, label=LABELS[name])
            axes[1].plot(x, -flight.position[:, 2], line, color=colour, label=f"{LABELS[name]}, height")
            axes[2].plot(x, flight.mach, line, color=colour, label=LABELS[name])
        axes[0].set_ylabel("angle of attack [deg]")
        axes[1].set_ylabel("height [m]")
        axes[2].set_ylabel("Mach number")
        axes[2].set_xlabel("distance down the range [m]")
        axes[0].legend(fontsize=8, loc="upper right")
        return figure


def difference_figure(flights: Mapping[str, Trajectory]) -> Figure:
    """What the model in the loop changes: difference of angle of attack and of height along the range."""
    first, second = flights["derivatives"], flights["rom"]
    x = first.position[:, 0]
    inside = (x >= second.position[0, 0]) & (x <= second.position[-1, 0])
    other = second.at_stations(x[inside])
    with figure_style() as plt:
        figure: Figure
        figure, axes = plt.subplots(2, 1, figsize=(8.6, 4.8), sharex=True)
        axes[0].plot(x[inside], np.degrees(other.alpha - first.alpha[inside]), color=VERMILION, lw=1.0)
        axes[0].set_ylabel("difference of α [deg]")
        axes[1].plot(x[inside], 1e3 * (first.position[inside, 2] - other.position[:, 2]), color=VERMILION, lw=1.0)
        axes[1].set_ylabel("difference of height [mm]")
        axes[1].set_xlabel("distance down the range [m]")
        axes[0].set_title("state-space model in the loop less derivative model")
        return figure


def angle_figure(flights: Mapping[str, Trajectory]) -> Figure:
    """Angle of attack against sideslip, in axes that do not roll, seen by someone looking downrange."""
    with figure_style() as plt:
        figure: Figure
        figure, panels = plt.subplots(1, len(flights), figsize=(4.6 * len(flights), 4.6), squeeze=False)
        reach = max(float(np.max(np.abs(flight.non_rolling_incidence))) for flight in flights.values())
        limit = 1.1 * np.degrees(reach)
        for axes, (name, flight) in zip(panels[0], flights.items(), strict=True):
            motion = math.degrees(1.0) * flight.non_rolling_incidence
            axes.plot(motion.real, motion.imag, color=_STYLES[name][0], lw=0.9)
            axes.plot(motion.real[0], motion.imag[0], "o", color=BLACK, ms=5, label="start")
            axes.plot(motion.real[-1], motion.imag[-1], "s", color=GREY, ms=5, label="end")
            axes.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
            axes.set_xlabel("β [deg], axes that do not roll")
            axes.set_ylabel("α [deg], axes that do not roll")
            axes.set_title(LABELS[name])
        panels[0, 0].legend(fontsize=8)
        return figure


def damping_figure(damping: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Damping of both arms, three ways, for both aerodynamic models.

    Parameters
    ----------
    damping : mapping
        By model: the record of ``results.json``.
    """
    ways = {"linearised_1_s": "linearised", "fitted_1_s": "fitted to the flight", "closed_form_1_s": "closed form"}
    with figure_style() as plt:
        figure: Figure
        figure, axes = plt.subplots(figsize=(8.0, 3.8))
        groups = [(name, arm) for name, record in damping.items() for arm in record["arms"]]
        for index, (colour, (key, label)) in enumerate(zip((BLUE, ORANGE, BLACK), ways.items(), strict=True)):
            places = np.arange(len(groups)) + 0.25 * (index - 1)
            axes.bar(places, [arm[key] for _, arm in groups], 0.22, color=colour, label=label)
        axes.set_xticks(range(len(groups)), [f"{LABELS[name]},\n{arm['name']}" for name, arm in groups], fontsize=8)
        axes.axhline(0.0, color=BLACK, lw=0.8)
        axes.set_ylabel("damping [1/s] (negative: dies out)")
        axes.legend(fontsize=8, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
        return figure


def record_figure(record: RangeRecord, residuals: Mapping[str, Array], noise: Mapping[str, float]) -> Figure:
    """Measured and fitted angles and swerve along the range, and the residuals in standard deviations.

    Parameters
    ----------
    record : RangeRecord
    residuals : mapping
        Measured less fitted, by channel [m] or [rad].
    noise : mapping
        Standard deviation of each channel, in the same units.
    """
    panels = ((("pitch", "yaw"), "angle [deg]", math.degrees(1.0)), (("y", "z"), "swerve [mm]\n(y right, z down)", 1e3))
    with figure_style() as plt:
        figure: Figure
        figure, axes = plt.subplots(3, 1, figsize=(8.6, 8.0), sharex=True)
        for ax, (names, label, scale) in zip(axes, panels, strict=False):
            for name, colour in zip(names, (BLUE, ORANGE), strict=True):
                measured = getattr(record, name)
                ax.plot(record.x, scale * measured, ".", color=colour, label=f"{name}, measured")
                ax.plot(record.x, scale * (measured - residuals[name]), color=colour, lw=0.8, label=f"{name}, fitted")
            ax.set_ylabel(label)
            ax.legend(fontsize=8, ncols=2)
        for (name, values), colour in zip(residuals.items(), _CHANNEL_COLOURS, strict=False):
            axes[2].plot(record.x, values / noise[name], ".", color=colour, ms=4, label=name)
        axes[2].axhspan(-2.0, 2.0, color=GREY, alpha=0.12, label="95% of white noise")
        axes[2].set_ylabel("residual / standard deviation")
        axes[2].set_xlabel("distance down the range [m]")
        axes[2].legend(fontsize=8, ncols=4)
        return figure
