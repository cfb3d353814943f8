"""How a steady state converged: kept with it, told in a line, shown in a figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array, Index

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class ConvergenceHistory:
    """One entry for each state that the iteration stood on: the start of each phase, then the end of each Newton step.

    Parameters
    ----------
    residual : ndarray
        Residual norm of the state in the scheme of its phase, relative to that of still air under the same motion (n,).
    cfl : ndarray
        Pseudo-time step, in signal crossings of a cell, of the Newton step that led there (n,); 0 at a phase's start.
    products : ndarray
        Products with J spent so far (n,), those of steps that were taken back included.
    second_order : ndarray
        Whether the phase is that of the second-order scheme (n,).
    round_off : float
        What double precision leaves of the residual, in the same units: no iteration gets much below it.
    """

    residual: Array
    cfl: Array
    products: Index
    second_order: NDArray[np.bool_]
    round_off: float

    @property
    def steps(self) -> int:
        """Newton steps taken."""
        return int(np.count_nonzero(self.cfl))

    @property
    def orders(self) -> float:
        """Decades between the largest residual on the way and the last."""
        return float(np.log10(np.max(self.residual) / self.residual[-1]))

    def summary(self) -> str:
        """The history in one line."""
        second = int(np.count_nonzero(self.cfl[self.second_order]))
        return (
            f"{self.steps - second} first-order and {second} second-order Newton steps, {self.products[-1]} products "
            f"with J: residual {self.residual[-1]:.1e} of still air's, {self.orders:.1f} orders below its largest, "
            f"round-off {self.round_off:.0e}"
        )

    def plot(self, panels: tuple[Axes, Axes] | None = None, label: str | None = None) -> Figure:
        """Residual over Newton steps and over products with J, first-order phase dotted.

        Parameters
        ----------
        panels : tuple of Axes, optional
            Where to draw; a new figure without.
        label : str, optional
            For the legend.
        """
        if panels is None:
            import matplotlib.pyplot as plt

            _, panels = plt.subplots(1, 2, sharey=True, figsize=(9.0, 4.0), layout="constrained")
        over_steps, over_products = panels
        colour = over_steps.plot([], [])[0].get_color()
        steps = np.cumsum(self.cfl > 0.0)
        for phase, style in ((~self.second_order, ":"), (self.second_order, "-")):
            shown = label if style == "-" else None
            line: dict[str, Any] = {"color": colour, "linestyle": style, "marker": ".", "linewidth": 1.0}
            over_steps.semilogy(steps[phase], self.residual[phase], label=shown, **line)
            over_products.semilogy(self.products[phase], self.residual[phase], **line)
        over_steps.set_xlabel("Newton step")
        over_products.set_xlabel("products with J")
        over_steps.set_ylabel("residual / residual of still air")
        figure = over_steps.get_figure(root=True)
        if figure is None:
            raise ValueError("the panels belong to no figure")
        return figure

    def to_arrays(self) -> dict[str, Array]:
        """The entries by name, for a file."""
        return {one.name: np.asarray(getattr(self, one.name)) for one in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> Self:
        """Read back what `to_arrays` gave, also as lists and with other entries beside."""
        kinds = {"residual": np.float64, "cfl": np.float64, "products": np.int64, "second_order": np.bool_}
        columns: dict[str, Any] = {name: np.asarray(arrays[name], dtype=kind) for name, kind in kinds.items()}
        return cls(**columns, round_off=float(arrays["round_off"]))


@dataclass
class Recorder:
    """Writes a `ConvergenceHistory` while the iteration runs."""

    _entries: list[tuple[float, float, int, bool]] = field(default_factory=list)
    products: int = 0

    def note(self, residual: float, cfl: float, second_order: bool) -> None:
        """A state that the iteration stands on."""
        self._entries.append((residual, cfl, self.products, second_order))

    @classmethod
    def of(cls, history: ConvergenceHistory) -> Self:
        """One that goes on with what another has written."""
        columns = (history.residual, history.cfl, history.products, history.second_order)
        entries = list(zip(*(column.tolist() for column in columns), strict=True))
        return cls(entries, int(history.products[-1]))

    @property
    def steps(self) -> int:
        """Newton steps so far."""
        return sum(cfl > 0.0 for _, cfl, _, _ in self._entries)

    @property
    def second_order(self) -> bool:
        """Whether the last phase so far is that of the second-order scheme."""
        return bool(self._entries) and self._entries[-1][3]

    def history(self, round_off: float) -> ConvergenceHistory:
        """All so far."""
        residual, cfl, products, second = (np.array(column) for column in zip(*self._entries, strict=True))
        return ConvergenceHistory(residual, cfl, products, second, round_off)
