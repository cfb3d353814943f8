r"""Which regressors an aerodynamic coefficient needs: stepwise choice among candidates by predicted squared error.

Candidates are made orthogonal to those chosen, so that each tells by itself what it would explain, and the next is the
one that explains most of what is left. A model of p terms of n samples is expected to predict new data with the error

    PSE = |z - zhat|^2/n + sigma_max^2 p/n,       sigma_max^2 = |z - mean(z)|^2/n,

fit error and a charge for every term; the terms up to the least PSE are kept, of which some may be dropped again that
the others have made needless (F below `least_f`). Source: Klein & Morelli, "Aircraft System Identification" (2006),
sec. 5.4; Barron, in "Self-Organizing Methods in Modeling" (1984), for the criterion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim import Vehicle
from indicial.identification.equation_error import EquationError, equation_error, read_equation
from indicial.identification.record import FlightRecord

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEFT = 1e-8  # of a candidate's size: what is left of it beside the chosen ones counts as nothing


@dataclass(frozen=True)
class Structure:
    """The terms of a coefficient.

    Parameters
    ----------
    coefficient : str
    chosen : tuple of str
        Regressors that are needed, in the order in which they were found.
    tried : tuple of str
        All candidates in the order in which they explained most.
    predicted_squared_error, r_squared : ndarray
        With the first k of `tried`, k from 0, shape (n_tried + 1,).
    dropped : tuple of str
        Chosen at first, needless beside the others.
    model : EquationError
        Of the chosen terms.
    """

    coefficient: str
    chosen: tuple[str, ...]
    tried: tuple[str, ...]
    predicted_squared_error: Array
    r_squared: Array
    dropped: tuple[str, ...]
    model: EquationError

    def summary(self) -> str:
        """The terms as they came in, and the model of those that stay."""
        lines = [f"structure of {self.coefficient} among {len(self.tried)} candidates, by predicted squared error"]
        for k, name in enumerate(self.tried, start=1):
            mark = "kept" if name in self.chosen else "dropped" if name in self.dropped else ""
            pse, explained = self.predicted_squared_error[k], self.r_squared[k]
            lines.append(f"  {k:>2} {name:<20} PSE {pse:.4g}  R^2 {explained:.5f}  {mark}".rstrip())
        return "\n".join([*lines, self.model.summary()])

    def plot(self) -> Figure:
        """Predicted squared error and what is not explained, term by term."""
        import matplotlib.pyplot as plt

        figure, ax = plt.subplots(figsize=(7.5, 4.0), layout="constrained")
        count = np.arange(self.predicted_squared_error.size)
        whole = self.predicted_squared_error[0]
        ax.semilogy(count, self.predicted_squared_error / whole, "o-", label="predicted squared error")
        ax.semilogy(count, np.maximum(1.0 - self.r_squared, 1e-16), "s--", label="fit error")
        ax.set_xticks(count, ["none", *self.tried], rotation=40, ha="right", fontsize=8)
        ax.axvline(int(np.argmin(self.predicted_squared_error)), color="0.6", linewidth=0.8)
        ax.set_ylabel("relative to no term")
        ax.legend(fontsize="small")
        return figure


def model_structure(
    record: FlightRecord,
    vehicle: Vehicle,
    coefficient: str,
    candidates: Sequence[str],
    *,
    least_f: float = 20.0,
    thrust: ArrayLike = 0.0,
) -> Structure:
    """Choose the regressors that a coefficient needs.

    Parameters
    ----------
    record, vehicle, coefficient, thrust
        As `equation_error`.
    candidates : sequence of str
        As its regressors; `polynomial_terms` makes them.
    least_f : float
        A chosen term whose F ratio beside all others is below this is dropped: 20 is five times the 95% value of one
        term among many samples, as the book advises.

    Raises
    ------
    InputError
        As `equation_error`, or if no candidate explains anything.
    """
    if not candidates:
        raise InputError("a model structure is chosen from at least one candidate")
    response, columns = read_equation(record, vehicle, coefficient, candidates, thrust)
    known = np.isfinite(response) & np.all(np.isfinite(columns), axis=1)
    if np.count_nonzero(known) < 2 * (len(candidates) + 1):
        raise InputError(f"{len(candidates)} candidates need {2 * (len(candidates) + 1)} samples with all channels")
    order, errors, explained = _orthogonal_order(response[known], columns[known])
    tried = tuple(candidates[i] for i in order)
    count = int(np.argmin(errors))
    kept, dropped = list(tried[:count]), []
    while kept:
        ratios = _partial_f(response[known], columns[known][:, [candidates.index(n) for n in kept]])
        worst = int(np.argmin(ratios))
        if ratios[worst] >= least_f:
            break
        dropped.append(kept.pop(worst))
    if not kept:
        raise InputError(f"none of the candidates explains {coefficient} by more than a term costs")
    model = equation_error(record, vehicle, coefficient, kept, thrust=thrust)
    return Structure(coefficient, tuple(kept), tried, errors, explained, tuple(dropped), model)


def _orthogonal_order(response: Array, columns: Array) -> tuple[list[int], Array, Array]:
    """Candidates in the order of what they explain, PSE and R^2 after each."""
    n = response.size
    z = response - response.mean()
    left = columns - columns.mean(axis=0)
    size = np.linalg.norm(left, axis=0)
    largest = float(z @ z) / n
    rest, order = z.copy(), list[int]()
    errors, explained = [largest], [0.0]
    open_ = [i for i in range(columns.shape[1]) if size[i] > 0.0]
    while open_:
        norms = np.linalg.norm(left[:, open_], axis=0)
        usable = [i for i, norm in zip(open_, norms, strict=True) if norm > _LEFT * size[i]]
        if not usable:
            break
        gains = [float(left[:, i] @ rest) ** 2 / float(left[:, i] @ left[:, i]) for i in usable]
        best = usable[int(np.argmax(gains))]
        direction = left[:, best] / np.linalg.norm(left[:, best])
        rest = rest - direction * (direction @ rest)
        left = left - np.outer(direction, direction @ left)
        left = left - np.outer(direction, direction @ left)  # twice is enough
        order.append(best)
        open_ = [i for i in usable if i != best]
        errors.append(float(rest @ rest) / n + largest * len(order) / n)
        explained.append(1.0 - float(rest @ rest) / (n * largest))
    return order, np.array(errors), np.array(explained)


def _partial_f(response: Array, columns: Array) -> Array:
    """F ratio of each term beside all others."""
    n, p = columns.shape
    full = np.column_stack([np.ones(n), columns])
    values, *_ = np.linalg.lstsq(full, response, rcond=None)
    residual = response - full @ values
    variance = float(residual @ residual) / (n - p - 1)
    inverse = np.linalg.pinv(full.T @ full)
    ratios: Array = values[1:] ** 2 / (variance * np.diag(inverse)[1:])
    return ratios
