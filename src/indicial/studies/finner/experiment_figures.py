"""Figures of the experiments: where the jump in Cm_alphadot sits, and what of the fins it depends on."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.conventions import Array
from indicial.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, symbol
from indicial.studies.finner.across_fins import AcrossFins
from indicial.studies.finner.variants import VARIANTS
from indicial.studies.finner.wedge import sonic_mach
from indicial.studies.kept import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Canvas = Callable[..., tuple["Figure", Any]]

NAME = "Cm_alphadot"

THICKNESSES = {
    "sting+plate_fins": (0.0, BLACK),
    "sting+thickness_0.02": (0.02, PURPLE),
    "sting+thickness_0.04": (0.04, SKY),
    "sting": (0.08, BLUE),
    "sting+thickness_0.12": (0.12, GREEN),
}
"""Kinds of mesh by the thickness of the fins' wedge over its chord, and the colours of their curves."""


def by_part(results: Results, canvas: _Canvas) -> Figure:
    """Cm_alphadot of each part of the body over Mach number."""
    figure, axes = canvas(figsize=(7.0, 4.4))
    for level, style in (("quick", "-"), ("coarse", "x")):
        found = results.select(method="parts", level=level)
        machs = found.machs()
        kept = [r.provenance["parts"] for mach in machs if (r := found.at(float(mach))) is not None]
        if not kept:
            continue
        for part, colour in zip(kept[0], (GREY, SKY, ORANGE, VERMILION), strict=True):
            label = part if level == "quick" else None
            axes.plot(machs, [one[part][NAME] for one in kept], style, color=colour, label=label)
        total = [sum(part[NAME] for part in one.values()) for one in kept]
        axes.plot(machs, total, style, color=BLACK, label="all" if level == "quick" else None)
    axes.axvline(sonic_mach(math.atan(0.04)), color=GREY, linestyle=":", label="wedge: sonic behind its shock")
    return _finish(figure, axes, "; crosses: coarse mesh")


def by_thickness(results: Results, canvas: _Canvas) -> Figure:
    """Cm_alphadot with fins of several thicknesses, and the Mach numbers at which a wedge's flow becomes subsonic."""
    figure, axes = canvas(figsize=(7.0, 4.4))
    for kind, (thickness, colour) in THICKNESSES.items():
        mach, value = jump(results, kind)
        axes.plot(mach, value, ".-", color=colour, label=f"fins {thickness:g} d thick" if thickness else "plates")
        if thickness:
            axes.axvline(sonic_mach(math.atan(0.5 * thickness)), color=colour, linestyle=":", linewidth=1.0)
    mach, value = jump(results, "sting+half_span")
    axes.plot(mach, value, "--", color=ORANGE, label="half the span")
    mach, value = jump(results, "sting+no_fins")
    axes.plot(mach, value, "--", color=GREY, label="no fins")
    return _finish(figure, axes, "; dotted: wedge, sonic behind its shock")


def jump(results: Results, kind: str) -> tuple[Array, Array]:
    """Mach numbers and Cm_alphadot at k = 0 on the quick mesh, of one kind."""
    method = "operator" if kind.partition("+")[2] in VARIANTS else "parts"
    return results.select(method=method, mesh=kind, level="quick").series(NAME, k=None)


def across_fins(results: Results, canvas: _Canvas) -> Figure:
    """Mach number and lagging pressure on a cylinder half way along the span, rolled out about one fin."""
    found = results.select(method="across_fins")
    flows = [AcrossFins.load(one.file("surface")) for mach in found.machs() if (one := found.at(float(mach)))]
    figure, axes = canvas(2, max(1, len(flows)), figsize=(10.2, 4.3), sharex=True, sharey=True, squeeze=False)
    for column, flow in enumerate(flows):
        surface = flow.surface
        x, arc = surface.points[:, 0], _arc(surface.points)
        late = 40.0
        shown = (("mach", 0.85, 1.35, "RdBu_r", "Mach number"), ("lag", -late, late, "PuOr_r", "lagging pressure"))
        for row, (name, low, high, colours, label) in enumerate(shown):
            ax = axes[row, column]
            values = surface.at_points(name)
            levels = np.linspace(low, high, 41)
            drawn = ax.tricontourf(x, arc, surface.triangles(), values, levels=levels, cmap=colours, extend="both")
            if name == "mach":
                ax.tricontour(x, arc, surface.triangles(), values, levels=[1.0], colors=BLACK, linewidths=1.2)
                ax.set_title(f"M {flow.mach:g}")
            if column == len(flows) - 1:
                figure.colorbar(drawn, ax=axes[row, :].tolist(), label=label, ticks=np.linspace(low, high, 5))
        axes[1, column].set_xlabel("x [d]")
    for ax in axes.ravel():
        ax.set_xlim(8.4, 11.0)
        ax.set_ylim(-0.7, 0.7)
        ax.set_aspect("equal")
        ax.grid(visible=False)
    for ax in axes[:, 0]:
        ax.set_ylabel("along the circle [d]")
    return figure


def _arc(points: Array) -> Array:
    """Distance along the circle from the upper fin [calibres]."""
    azimuth = np.arctan2(points[:, 2], points[:, 1]) - 0.25 * math.pi
    return np.asarray(np.hypot(points[:, 1], points[:, 2]) * azimuth)


def _finish(figure: Figure, axes: Axes, note: str) -> Figure:
    axes.set_xlabel(f"Mach number{note}")
    axes.set_ylabel(f"{symbol(NAME)} [1/rad]")
    axes.legend(fontsize=8)
    return figure


FIGURES: dict[str, Callable[[Results, _Canvas], Figure]] = {
    "jump_by_part": by_part,
    "jump_by_thickness": by_thickness,
    "across_fins": across_fins,
}
