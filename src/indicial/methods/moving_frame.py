r"""Steady solutions in a moving frame: static and rotational derivatives by difference quotients (Eq. 23).

Also called MRF. A body at constant velocity and constant rate sees a steady flow in its own axes, so each derivative
costs a pair of steady solutions. It is ``H_q(0)`` of the linear response, without frequency.
Not to be confused with steady flight in a turn: alpha and speed stay those of the moment reference point.

The experiments and their reading are apart, so that a pipeline can run each as a job of its own:
`experiments` lists them, any solver runs them, `read` makes the derivatives; `run` does all three.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Literal

from indicial.conventions import COEFFICIENTS, ReferenceQuantities
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.motion import FlightCondition, Rates
from indicial.solver import Solver, SteadyLoads

Variable = Literal["alpha", "beta", "p", "q", "r"]

AMPLITUDES: Mapping[str, float] = MappingProxyType({"alpha": 5e-3, "beta": 5e-3, "p": 5e-3, "q": 1e-3, "r": 1e-3})
"""Default half-differences: angles [rad], rates reduced as the reference quantities say. On a tail four calibres aft a
reduced pitch rate of 1e-3 is 0.5 degrees of incidence."""

LOADS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "alpha": ("CA", "CN", "Cm"),
        "q": ("CA", "CN", "Cm"),
        "beta": ("CY", "Cl", "Cn"),
        "p": ("CY", "Cl", "Cn"),
        "r": ("CY", "Cl", "Cn"),
    }
)
"""The loads read for each variable: longitudinal with longitudinal, lateral with lateral."""

BASE = "base"


@dataclass(frozen=True)
class Experiment:
    """One steady solution.

    Parameters
    ----------
    label : str
        Unique: ``base``, ``q+``, ``q-``, and ``q++``, ``q--`` at the second amplitude.
    variable : str
        What is disturbed; empty for the base.
    amplitude : float
        Signed disturbance: rad, or reduced rate.
    condition : FlightCondition
    rates : Rates
    """

    label: str
    variable: str
    amplitude: float
    condition: FlightCondition
    rates: Rates = Rates()


@dataclass(frozen=True)
class MovingFrameResult:
    """Derivatives by differences of steady solutions.

    Parameters
    ----------
    values : dict
        By name: ``CN_alpha``, ``Cm_q``, ``Cl_p``, ..., and ``CA_0``, ``CN_0``, ``Cm_0`` of the base. Per rad, rates as
        `reference` normalises them.
    changes : dict
        By name: value at the second amplitude less `values`; empty without a second amplitude. It holds both
        non-linearity and incomplete convergence, and its size is taken as the uncertainty.
    amplitudes : dict
        Half-difference of each variable [rad, or reduced rate].
    condition : FlightCondition
    reference : ReferenceQuantities
    source : str
    convergence : dict
        What the solver said of each solution, by label.
    """

    values: dict[str, float]
    changes: dict[str, float]
    amplitudes: dict[str, float]
    condition: FlightCondition
    reference: ReferenceQuantities
    source: str = "moving frame"
    convergence: dict[str, dict[str, Any]] = field(default_factory=dict)

    def __getitem__(self, name: str) -> float:
        if name not in self.values:
            raise InputError(f"no derivative {name!r} by moving frame; there are {', '.join(self.values)}")
        return self.values[name]

    def linearity(self, name: str) -> float:
        """Relative change of a derivative from the first amplitude to the second."""
        if name not in self.changes:
            raise InputError(f"{name} was not found at a second amplitude")
        return abs(self.changes[name]) / max(abs(self[name]), 1e-300)

    def derivatives(self) -> DerivativeTable:
        """The records, method ``mrf``."""

        def amplitude(name: str) -> float | None:
            variable = name.partition("_")[2]
            return self.amplitudes[variable] if variable in ("alpha", "beta") else None

        return DerivativeTable(
            tuple(
                Derivative.at(
                    self.condition,
                    self.reference,
                    name,
                    "mrf",
                    value,
                    self.source,
                    uncertainty=abs(self.changes[name]) if name in self.changes else None,
                    amplitude=amplitude(name),
                )
                for name, value in self.values.items()
            )
        )

    def summary(self) -> str:
        """A text table."""
        rows = [f"moving frame at M {self.condition.mach:g}: derivative, value, relative change at second amplitude"]
        for name, value in self.values.items():
            change = f"{self.linearity(name):10.2g}" if name in self.changes else ""
            rows.append(f"{name:<10}{value:>13.6g}{change}")
        return "\n".join(rows)


def experiments(
    condition: FlightCondition,
    reference: ReferenceQuantities,
    variables: Sequence[Variable] = ("alpha", "q"),
    *,
    amplitudes: Mapping[str, float] | None = None,
    second: float | None = 2.0,
    one_sided: bool = False,
) -> tuple[Experiment, ...]:
    """The steady solutions that the derivatives need.

    Parameters
    ----------
    condition : FlightCondition
        The state about which the derivatives are taken, at zero rates.
    reference : ReferenceQuantities
    variables : sequence of {"alpha", "beta", "p", "q", "r"}
    amplitudes : mapping, optional
        Half-differences where they are not those of `AMPLITUDES`.
    second : float or None
        Factor of the second amplitude; None for none.
    one_sided : bool
        Differences from the base instead of central ones: half the cost, first order in the amplitude.
    """
    if second is not None and second in (0.0, 1.0, -1.0):
        raise InputError(f"the factor of the second amplitude is {second:g}, must differ from 0, 1 and -1")
    sizes = {**AMPLITUDES, **(amplitudes or {})}
    signs = (1.0,) if one_sided else (1.0, -1.0)
    factors = (1.0,) if second is None else (1.0, second)
    listed = [Experiment(BASE, "", 0.0, condition)]
    for variable in variables:
        if variable not in LOADS:
            raise InputError(f"no variable {variable!r}; there are {', '.join(LOADS)}")
        if sizes[variable] == 0.0:
            raise InputError(f"the amplitude of {variable} must not be zero")
        for count, factor in enumerate(factors, start=1):
            for sign in signs:
                label = variable + ("+" if sign > 0.0 else "-") * count
                listed.append(_disturbed(label, variable, sign * factor * sizes[variable], condition, reference))
    return tuple(listed)


def _disturbed(
    label: str, variable: str, amplitude: float, condition: FlightCondition, reference: ReferenceQuantities
) -> Experiment:
    if variable == "alpha":
        return Experiment(label, variable, amplitude, replace(condition, alpha=condition.alpha + amplitude))
    if variable == "beta":
        return Experiment(label, variable, amplitude, replace(condition, beta=condition.beta + amplitude))
    scale = dict(zip("pqr", reference.rate_scale(condition.speed), strict=True))[variable]
    return Experiment(label, variable, amplitude, condition, Rates(**{variable: float(amplitude / scale)}))


def read(
    planned: Sequence[Experiment], loads: Mapping[str, SteadyLoads], *, source: str = "moving frame"
) -> MovingFrameResult:
    """Derivatives from the loads of every experiment, by label (Eq. 23).

    Raises
    ------
    InputError
        If the loads of an experiment are missing.
    """
    missing = [one.label for one in planned if one.label not in loads]
    if missing:
        raise InputError(f"loads of the experiments {', '.join(missing)} are missing")
    by_label = {one.label: one for one in planned}
    base = loads[BASE]
    values = {f"{name}_0": base[name] for name in ("CA", "CN", "Cm")}
    changes: dict[str, float] = {}
    variables = list(dict.fromkeys(one.variable for one in planned if one.variable))
    for variable in variables:
        for name in LOADS[variable]:
            index = COEFFICIENTS.index(name)
            first = _quotient(variable, 1, index, by_label, loads)
            values[f"{name}_{variable}"] = first
            if f"{variable}++" in by_label:
                changes[f"{name}_{variable}"] = _quotient(variable, 2, index, by_label, loads) - first
    return MovingFrameResult(
        values,
        changes,
        {variable: abs(by_label[f"{variable}+"].amplitude) for variable in variables},
        by_label[BASE].condition,
        base.reference,
        source,
        {one.label: dict(loads[one.label].convergence) for one in planned},
    )


def _quotient(
    variable: str, count: int, index: int, planned: Mapping[str, Experiment], loads: Mapping[str, SteadyLoads]
) -> float:
    up, down = variable + "+" * count, variable + "-" * count
    below = down if down in planned else BASE
    difference = loads[up].coefficients[index] - loads[below].coefficients[index]
    return float(difference / (planned[up].amplitude - planned[below].amplitude))


def run(
    solver: Solver,
    condition: FlightCondition,
    variables: Sequence[Variable] = ("alpha", "q"),
    *,
    amplitudes: Mapping[str, float] | None = None,
    second: float | None = 2.0,
    one_sided: bool = False,
    source: str = "moving frame",
) -> MovingFrameResult:
    """Plan, solve and read; see `experiments` for the parameters."""
    planned = experiments(
        condition, solver.reference, variables, amplitudes=amplitudes, second=second, one_sided=one_sided
    )
    return read(planned, {one.label: solver.steady(one.condition, one.rates) for one in planned}, source=source)
