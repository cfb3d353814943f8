"""The path of a flight in space, with the body's axes along it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from indicial.flightsim.attitude import matrix_from_quaternion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from indicial.flightsim.trajectory import Trajectory

_BODIES = 12
_AXES = (("x, forward", "C3"), ("y, right", "C2"), ("z, down", "C0"))


def plot_path(flight: Trajectory, bodies: int = _BODIES) -> Figure:
    """The path with its shadow on the ground, and the body's axes at evenly spaced instants.

    The picture's axes may have scales of their own; the body's are then stretched as the path is.
    """
    import matplotlib.pyplot as plt

    x, y, z = flight.position.T
    height = -z
    figure = plt.figure(figsize=(8.5, 6.5), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    axes.plot(x, y, height, color="k", linewidth=1.0, label="path")
    spans = np.array([np.ptp(x), np.ptp(y), np.ptp(height)])
    spans = np.maximum(spans, 0.02 * np.max(spans))
    middle = np.array([np.mean([v.min(), v.max()]) for v in (x, y, height)])
    floor = float(middle[2] - 0.62 * spans[2])
    axes.plot(x, y, np.full_like(x, floor), color="0.4", linestyle=":", linewidth=1.5, label="shadow")
    at = np.unique(np.linspace(0, len(flight) - 1, bodies).astype(int))
    turned = matrix_from_quaternion(flight.quaternion[at])
    for k, (name, colour) in enumerate(_AXES):
        # a tenth of the picture in every direction, whatever its scale
        arrow = turned[:, :, k] * np.array([1.0, 1.0, -1.0]) * 0.1 * spans
        ends = np.stack([x[at], y[at], height[at]], axis=1)
        for i, (start, along) in enumerate(zip(ends, arrow, strict=True)):
            axes.plot(*np.stack([start, start + along], axis=1), color=colour, label=name if i == 0 else None)
    for setter, centre, span in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), middle, spans, strict=True):
        setter(centre - 0.62 * span, centre + 0.62 * span)
    axes.set(xlabel="x, downrange [m]", ylabel="y, right [m]", zlabel="height [m]")
    axes.invert_yaxis()  # right of the flight on the right of someone who looks downrange
    axes.legend(loc="upper left", fontsize="small")
    return figure
