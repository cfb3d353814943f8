"""Pictures of the flow in a steady pitch rate: pressure on the body, shocks in the symmetry plane."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.report.solid import View, draw_solid, whole
from indicial.report.style import BLACK, VERMILION
from indicial.studies.finner.pitching_flow import PitchingFlow
from indicial.studies.finner.variants import FINNER
from indicial.studies.kept import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ABOVE, BELOW = View(math.radians(-28.0), math.radians(24.0)), View(math.radians(-28.0), math.radians(-24.0))

LENGTH, HEIGHT = (-1.0, 12.0), 9.0
"""Part of the symmetry plane that is shown: x from and to, and at most that high [calibres]."""


def surface_pressure(results: Results, plt: Any) -> Figure | None:
    """Pressure on the body in a steady pitch rate, seen from above and from below."""
    flows = _flows(results)
    if not flows:
        return None
    figure: Figure
    figure, panels = plt.subplots(len(flows), 2, figsize=(13.0, 2.5 * len(flows) + 0.8), squeeze=False)
    for row, flow in zip(panels, flows, strict=True):
        pressure = flow.wall.values["cp"]
        limit = float(np.quantile(np.abs(pressure), 0.98))
        scale = plt.cm.ScalarMappable(plt.Normalize(-limit, limit), "RdBu_r")
        for axes, view in zip(row, (ABOVE, BELOW), strict=True):
            draw_solid(axes, whole(flow.wall.corners), scale.to_rgba(np.tile(pressure, 2)), view)
        row[0].text(0.02, 0.75, f"M {flow.mach:g}", transform=row[0].transAxes, fontsize=15)
        figure.colorbar(scale, ax=row, label="pressure coefficient", shrink=0.9, aspect=14, pad=0.01)
    panels[0, 0].set_title("seen from above")
    panels[0, 1].set_title("seen from below")
    figure.suptitle(
        f"{_flight(flows[0])}: nose up, tail down.\n"
        "The nose meets the air from above, the fins from below: both resist the rotation."
    )
    return figure


def shock_pattern(results: Results, plt: Any) -> Figure | None:
    """Mach number and isobars in the symmetry plane."""
    flows = _flows(results)
    if not flows:
        return None
    figure: Figure
    heights = [min(float(np.ptp(flow.plane.points[:, 2])), HEIGHT) for flow in flows]
    figure, panels = plt.subplots(
        len(flows), 1, figsize=(10.0, 0.62 * sum(heights) + 1.1 * len(flows)), squeeze=False, height_ratios=heights
    )
    for axes, flow in zip(panels[:, 0], flows, strict=True):
        _symmetry_plane(axes, flow)
    figure.suptitle(f"{_flight(flows[0])}: symmetry plane")
    return figure


def _symmetry_plane(axes: Axes, flow: PitchingFlow) -> None:
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    plane = flow.plane
    x, z, mach = plane.points[:, 0], plane.points[:, 2], plane.at_points("mach")
    triangles = Triangulation(x, z, plane.triangles())
    spread = float(np.quantile(np.abs(mach - flow.mach), 0.98))
    levels = flow.mach + np.linspace(-spread, spread, 61)
    ticks = [tick for tick in MaxNLocator(7).tick_values(levels[0], levels[-1]) if levels[0] < tick < levels[-1]]
    filled = axes.tricontourf(triangles, mach, levels, cmap="RdYlBu_r", extend="both")
    axes.figure.colorbar(filled, ax=axes, label="Mach number", shrink=0.75, aspect=18, ticks=ticks, pad=0.02)
    pressure = plane.at_points("cp")
    bound = float(np.quantile(np.abs(pressure), 0.98))
    isobars = [level for level in np.linspace(-bound, bound, 25) if abs(level) > 0.02 * bound]
    axes.tricontour(triangles, pressure, isobars, colors=BLACK, linewidths=0.35, linestyles="solid")
    if mach.min() < 1.0 < flow.mach:
        axes.tricontour(triangles, mach, [1.0], colors=VERMILION, linewidths=1.6)
        axes.plot([], [], color=VERMILION, lw=1.6, label="sonic line")
    axes.plot(
        [], [], color=BLACK, lw=0.6, label=f"isobars, {isobars[1] - isobars[0]:.2g} in pressure coefficient apart"
    )
    shoulder, base = FINNER.nose.length, FINNER.length
    axes.fill([0.0, shoulder, base, base, shoulder], [0.0, 0.5, 0.5, -0.5, -0.5], color="0.3")
    if x.max() > base:
        axes.fill([base, LENGTH[1], LENGTH[1], base], [0.5, 0.5, -0.5, -0.5], color="0.6", label="sting")
    for side in (-1.0, 1.0):
        _fin(axes, side)
    axes.plot([], [], color="0.3", lw=1.0, ls="--", label="fins, at 45° to the plane")
    axes.set(xlabel="x/d, aft of the nose", ylabel="z/d", aspect="equal")
    half = 0.5 * min(float(np.ptp(z)), HEIGHT)
    axes.set(xlim=LENGTH, ylim=(-half, half))
    axes.grid(visible=False)
    axes.set_title(f"M {flow.mach:g}")
    axes.legend(loc="upper left", fontsize=8)


def _fin(axes: Axes, side: float) -> None:
    """Outline of the fins at 45 degrees to the plane, as the eye sees them."""
    assert FINNER.fins is not None
    root, tip = (radius * math.sqrt(0.5) * side for radius in (0.5, 0.5 + FINNER.fins.span))
    front, back = FINNER.fins.root_leading_edge, FINNER.fins.trailing_edge
    axes.fill([front, front, back, back], [root, tip, tip, root], facecolor="none", edgecolor="0.3", lw=1.0, ls="--")


def _flows(results: Results) -> list[PitchingFlow]:
    """Kept flows in order of Mach number."""
    flows = [PitchingFlow.load(r.file("flow")) for r in results.select(method="field")]
    return sorted(flows, key=lambda flow: flow.mach)


def _flight(flow: PitchingFlow) -> str:
    return f"Steady pitch, q d/2V = {flow.q:g}, angle of attack {math.degrees(flow.alpha):g}° at 5.5 d"
