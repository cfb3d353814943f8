"""Pictures of what flight tests give: each estimate beside the values that others have for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from indicial.report.style import figure_style, symbol

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Values = Mapping[str, tuple[float, float]]
"""By name: value and standard error."""

INTERVAL = 1.96
_STYLES = (("o", "#0072b2"), ("s", "#e69f00"), ("*", "#000000"), ("^", "#009e73"))


def estimates_figure(names: Sequence[str], sources: Mapping[str, Values]) -> Figure:
    """Values relative to those of the first source, with 95% intervals, one line each.

    Parameters
    ----------
    names : sequence of str
        In the order of the lines; those whose first value is 0 or less sure than its size are left out, as a ratio to
        them says nothing.
    sources : mapping
        Up to four, by what the legend calls them.
    """
    first = next(iter(sources.values()))
    shown = [name for name in names if name in first and abs(first[name][0]) > INTERVAL * first[name][1]]
    with figure_style() as plt:
        figure: Figure
        figure, axes = plt.subplots(figsize=(8.6, 0.36 * len(shown) + 1.4))
        for number, (source, (marker, colour)) in enumerate(zip(sources.items(), _STYLES, strict=False)):
            label, values = source
            rows = [(line, name) for line, name in enumerate(shown) if name in values]
            axes.errorbar(
                [values[name][0] / first[name][0] for _, name in rows],
                [line + 0.22 * number - 0.11 * (len(sources) - 1) for line, _ in rows],
                xerr=[INTERVAL * abs(values[name][1] / first[name][0]) for _, name in rows],
                fmt=marker,
                color=colour,
                ms=8 if marker == "*" else 5,
                capsize=2,
                label=label,
            )
        axes.axvline(1.0, color="0.4", lw=0.8)
        axes.set_yticks(range(len(shown)), [symbol(name) for name in shown])
        axes.set_ylim(len(shown) - 0.4, -0.6)
        axes.set_xlabel(f"value / {next(iter(sources))}, with 95% intervals")
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
        return figure
