r"""Indicial responses: steps in alpha, beta, p, q and r, and the derivatives in them (Eqs. 13-17).

Also called IRM. A step in alpha or beta is a jump of V_b at constant attitude, a step in a rate a jump of it at
constant V_b in body axes. Per unit step, a load's response starts at its piston value, tends to ``C_ja`` or ``C_jq``,
and the area it lacks on the way is ``C_jad = -integral_0^inf F_ja ds`` per ``alphadot c/2U`` (Eq. 17), s = 2Ut/c.
The integral is taken by `indicial.rom.deficiency`, which refuses it where it has no limit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities, time_from_reduced
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError, NoLimitError
from indicial.history import History
from indicial.motion import (
    AlphaStep,
    FlightCondition,
    PitchRateStep,
    Rates,
    RateStep,
    RollRateStep,
    SideslipStep,
    YawRateStep,
)
from indicial.rom.deficiency import DeficiencyIntegral, deficiency, deficiency_integral
from indicial.solver import Solver, SteadyLoads

if TYPE_CHECKING:
    from matplotlib.axes import Axes

StepKind = Literal["alpha", "beta", "p", "q", "r"]
Step = AlphaStep | SideslipStep | RateStep

LOADS = ("CN", "Cm")
"""Loads whose longitudinal derivatives are found."""

LATERAL_LOADS = ("CY", "Cl", "Cn")
"""Loads whose lateral derivatives are found."""

_BY_INCIDENCE = ("_alpha", "_alphadot", "_beta", "_betadot")
_INCIDENCE: dict[str, type[AlphaStep | SideslipStep]] = {"alpha": AlphaStep, "beta": SideslipStep}
_RATE: dict[str, type[RateStep]] = {step.axis: step for step in (RollRateStep, PitchRateStep, YawRateStep)}
_KINDS = {"alpha_step": "alpha", "beta_step": "beta", **{step.kind: step.axis for step in _RATE.values()}}


@dataclass(frozen=True)
class StepResponse:
    """Response per unit step, with the first instant kept.

    Parameters
    ----------
    kind : {"alpha", "beta", "p", "q", "r"}
        Per rad, or per unit of the rate reduced as `reference` says.
    amplitude : float
        Of the step that was made [rad, or reduced rate]; of a pair, its largest.
    s : ndarray
        Reduced time 2Ut/c from 0 (0+), shape (n,).
    response : ndarray
        Of (CA, CY, CN, Cl, Cm, Cn), shape (n, 6).
    final : dict
        C(inf) per unit step by load, from a steady solution after the step; a load without one has it estimated.
    condition : FlightCondition
    reference : ReferenceQuantities
    impulse : dict
        ``integral of C ds`` over the instant of the jump itself per unit step, by load: the added mass of an
        incompressible flow, which no sample can show (`History.provenance`). None in a compressible one.
    """

    kind: StepKind
    amplitude: float
    s: Array
    response: Array
    final: dict[str, float]
    condition: FlightCondition
    reference: ReferenceQuantities
    impulse: dict[str, float] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Array:
        """Response of one load, shape (n,)."""
        return self.response[:, _index(name)]

    def initial(self, name: str) -> float:
        """The piston jump: response at 0+."""
        return float(self[name][0])

    def limit(self, name: str) -> tuple[float, float | None]:
        """C(inf), and its uncertainty where it had to be estimated.

        Without a steady solution it is the last sample, uncertain by the largest departure from it over the last half
        of the record (for a 1/s tail that is just what is still missing).
        """
        if name in self.final:
            return self.final[name], None
        values = self[name]
        late = values[self.s >= 0.5 * self.s[-1]]
        return float(values[-1]), float(np.max(np.abs(late - values[-1])))

    def deficiency(self, name: str) -> Array:
        """``F = C(inf) - C(s)`` (Eqs. 14, 15), shape (n,)."""
        return deficiency(self[name], self.limit(name)[0])

    def integral(self, name: str, *, noise: float = 1e-4) -> DeficiencyIntegral:
        """``integral_0^inf F ds`` with its error bar; see `deficiency_integral`, also for what it refuses."""
        label = f"{name} after a step in {self.kind}"
        found = deficiency_integral(self.s, self[name], self.final.get(name), noise=noise, name=label)
        return replace(found, value=found.value - self.impulse.get(name, 0.0))

    @property
    def loads(self) -> tuple[str, ...]:
        """What a step of this kind moves."""
        return LOADS if self.kind in ("alpha", "q") else LATERAL_LOADS

    def plot(self, names: tuple[str, ...] | None = None, ax: Axes | None = None) -> Axes:
        """Responses per unit step against reduced time; of `loads`, if not named."""
        import matplotlib.pyplot as plt

        axes: Axes = plt.subplots()[1] if ax is None else ax
        for name in self.loads if names is None else names:
            axes.plot(self.s, self[name], label=name)
        axes.set_xlabel("reduced time s = 2Ut/c")
        axes.set_ylabel(f"response per unit {self.kind}")
        axes.legend()
        return axes

    def summary(self) -> str:
        """One line a load."""
        rows = [f"step in {self.kind} of {self.amplitude:.3g} at M {self.condition.mach:g}, to s = {self.s[-1]:.4g}"]
        rows += [f"{name}: {self.initial(name):.6g} at 0+, {self.limit(name)[0]:.6g} in the end" for name in self.loads]
        return "\n".join(rows)


@dataclass(frozen=True)
class IndicialResult:
    """Derivatives from step responses.

    Parameters
    ----------
    values : dict
        By name: ``CN_alpha``, ``CN_q``, ``CN_alphadot``, ``CN_q+CN_alphadot``, and Cm likewise; or ``CY_beta``,
        ``CY_betadot``, ``CY_p``, ``CY_r``, and Cl and Cn likewise; rates as `reference` normalises them.
    uncertainties : dict
        By name, None where not known: tail, quadrature, and the change at the second amplitude.
    refused : dict
        Reason by name of each derivative that has no value.
    integrals : dict
        The deficiency integral of each load.
    amplitude : float
        Of the step in alpha or beta [rad].
    condition : FlightCondition
    reference : ReferenceQuantities
    """

    values: dict[str, float]
    uncertainties: dict[str, float | None]
    refused: dict[str, str]
    integrals: dict[str, DeficiencyIntegral]
    amplitude: float
    condition: FlightCondition
    reference: ReferenceQuantities

    def __getitem__(self, name: str) -> float:
        if name in self.refused:
            raise NoLimitError(f"{name} was refused: {self.refused[name]}")
        if name not in self.values:
            raise InputError(f"no derivative {name!r} by indicial response; there are {', '.join(self.values)}")
        return self.values[name]

    def derivatives(self, source: str = "indicial response") -> DerivativeTable:
        """The records that have a value, method ``irm``."""
        return DerivativeTable(
            tuple(
                Derivative.at(
                    self.condition,
                    self.reference,
                    name,
                    "irm",
                    value,
                    source,
                    uncertainty=self.uncertainties[name],
                    amplitude=self.amplitude if name.endswith(_BY_INCIDENCE) and "+" not in name else None,
                )
                for name, value in self.values.items()
            )
        )

    def summary(self) -> str:
        """A text table, refusals included."""
        rows = [f"indicial response at M {self.condition.mach:g}"]
        for name, value in self.values.items():
            spread = self.uncertainties[name]
            rows.append(f"{name:<18}{value:>13.6g}{'' if spread is None else f'  +- {spread:.2g}'}")
        rows += [f"{name:<18}      refused: {reason}" for name, reason in self.refused.items()]
        return "\n".join(rows)


def step_times(first: float, growth: float, largest: float, end: float) -> Array:
    """Instants from 0 to `end` with steps that grow as the response settles; all in one unit, s or seconds.

    Steps are ``first * growth^i`` until `largest`; the last ones are stretched or shrunk together to meet `end`.

    Raises
    ------
    InputError
    """
    if not (0.0 < first <= largest and growth >= 1.0 and end > 0.0 and np.isfinite(end)):
        raise InputError(
            f"step times need 0 < first <= largest, growth >= 1 and end > 0, not first {first:g}, largest {largest:g}, "
            f"growth {growth:g}, end {end:g}"
        )
    steps = []
    reached, step = 0.0, first
    while reached < end * (1.0 - 1e-12):
        steps.append(step)
        reached += step
        step = min(step * growth, largest)
    times: Array = np.concatenate([[0.0], np.cumsum(steps)])
    times *= end / times[-1]
    return times


def experiment(
    condition: FlightCondition, reference: ReferenceQuantities, amplitude: float, kind: StepKind = "alpha"
) -> Step:
    """The step: `amplitude` in rad of alpha or beta, or in a reduced rate as `reference` normalises it.

    Raises
    ------
    InputError
        If there is no such step, or no amplitude.
    """
    if kind not in (*_INCIDENCE, *_RATE):
        raise InputError(f"no step in {kind!r}; there are {', '.join((*_INCIDENCE, *_RATE))}")
    if not (np.isfinite(amplitude) and amplitude != 0.0):
        raise InputError(f"step amplitude is {amplitude}, must be finite and not zero")
    if kind in _INCIDENCE:
        return _INCIDENCE[kind](condition, amplitude)
    return _RATE[kind](condition, amplitude / _rate_scale(kind, condition, reference))


def _rate_scale(kind: str, condition: FlightCondition, reference: ReferenceQuantities) -> float:
    """Seconds that make a rate dimensionless."""
    return float(reference.rate_scale(condition.speed)["pqr".index(kind)])


def after(step: Step) -> tuple[FlightCondition, Rates]:
    """The steady state to which a step leads; its loads give C(inf)."""
    if isinstance(step, AlphaStep):
        return replace(step.condition, alpha=step.condition.alpha + step.amplitude), Rates()
    if isinstance(step, SideslipStep):
        return replace(step.condition, beta=step.condition.beta + step.amplitude), Rates()
    return step.condition, step.rates


def run(solver: Solver, condition: FlightCondition, amplitude: float, s: Array, kind: StepKind = "alpha") -> History:
    """Make the step and record it at reduced times `s` (see `step_times`); read it with `read`."""
    times = time_from_reduced(s, condition.speed, solver.reference.length)
    return solver.unsteady(condition, experiment(condition, solver.reference, amplitude, kind), times)


def read(history: History, final: SteadyLoads | Mapping[str, float] | None = None) -> StepResponse:
    """Response per unit step.

    Parameters
    ----------
    history : History
        Of a step.
    final : SteadyLoads or mapping, optional
        The steady loads of `after`, from the solver that made the history; or C(inf) per unit step (the
        derivatives) by load. Without it, it is estimated from the record.
    """
    step = history.motion.get("kind")
    if step not in _KINDS:
        raise InputError(f"a history of {step!r} is no step; those are {', '.join(_KINDS)}")
    kind: StepKind = _KINDS[step]  # type: ignore[assignment]
    if kind in _INCIDENCE:
        amplitude = float(history.motion["amplitude"])
    else:
        amplitude = float(history.motion["rate_amplitude"]) * _rate_scale(kind, history.condition, history.reference)
    if isinstance(final, SteadyLoads):
        limits = (final.coefficients - history.before) / amplitude
        final = dict(zip(COEFFICIENTS, limits.tolist(), strict=True))
    return StepResponse(
        kind=kind,
        amplitude=amplitude,
        s=history.s,
        response=(history.coefficients - history.before) / amplitude,
        final={name: float(value) for name, value in (final or {}).items() if _index(name) >= 0},
        condition=history.condition,
        reference=history.reference,
        impulse={name: float(value) / amplitude for name, value in history.provenance.get("impulse", {}).items()},
    )


def average(one: StepResponse, other: StepResponse) -> StepResponse:
    """Mean of the responses to a step and to its opposite: what is even in the amplitude drops out."""
    _same_times(one, other)
    return replace(
        one,
        amplitude=max(abs(one.amplitude), abs(other.amplitude)),
        response=(one.response + other.response) / 2.0,
        final={name: (one.final[name] + other.final[name]) / 2.0 for name in one.final if name in other.final},
    )


def linearity(one: StepResponse, other: StepResponse) -> dict[str, float]:
    """Largest difference between two responses per unit step, of the largest response; by load.

    Near 0 for two amplitudes, or a step and its opposite, where the flow is linear. 0 for a load that does not respond.
    """
    _same_times(one, other)
    size = np.max(np.abs(one.response), axis=0)
    change = np.max(np.abs(one.response - other.response), axis=0)
    alive = size > 1e-12 * np.max(size)
    relative = np.divide(change, size, out=np.zeros_like(change), where=alive)
    return dict(zip(COEFFICIENTS, relative.tolist(), strict=True))


def derive(
    alpha: StepResponse,
    q: StepResponse | None = None,
    *,
    alpha_check: StepResponse | None = None,
    q_check: StepResponse | None = None,
    noise: float = 1e-4,
) -> IndicialResult:
    """Derivatives from a step in alpha, and from one in q where given.

    Parameters
    ----------
    alpha, q : StepResponse
        ``C_ja``, ``C_jad`` (Eq. 17) come from the first, ``C_jq`` from the second.
    alpha_check, q_check : StepResponse, optional
        The same steps at another amplitude or sign; what changes enters the uncertainties.
    noise : float
        See `deficiency_integral`.
    """
    if alpha.kind != "alpha" or (q is not None and q.kind != "q"):
        raise InputError("derive needs a step in alpha, and then one in q")
    found = _Found({}, {}, {}, {})
    for name in LOADS:
        found.limit(name, alpha, alpha_check)
        if q is not None:
            found.limit(name, q, q_check)
        found.lag(name, alpha, alpha_check, noise)
        if q is not None:
            found.sum(f"{name}_q", f"{name}_alphadot")
    return found.result(alpha)


def derive_lateral(
    beta: StepResponse,
    p: StepResponse | None = None,
    r: StepResponse | None = None,
    *,
    beta_check: StepResponse | None = None,
    p_check: StepResponse | None = None,
    r_check: StepResponse | None = None,
    noise: float = 1e-4,
) -> IndicialResult:
    """Lateral derivatives from a step in beta, and from ones in p and r where given.

    As `derive`, of CY, Cl and Cn: ``C_beta`` and ``C_betadot`` (per ``betadot b/2U``), ``C_p``, ``C_r``.
    """
    for kind, one in (("beta", beta), ("p", p), ("r", r)):
        if one is not None and one.kind != kind:
            raise InputError("derive_lateral needs a step in beta, and then ones in p and r")
    found = _Found({}, {}, {}, {})
    for name in LATERAL_LOADS:
        found.limit(name, beta, beta_check)
        for one, check in ((p, p_check), (r, r_check)):
            if one is not None:
                found.limit(name, one, check)
        found.lag(name, beta, beta_check, noise)
    return found.result(beta)


@dataclass(frozen=True)
class _Found:
    """Values, uncertainties, refusals and integrals as they are found."""

    values: dict[str, float]
    spreads: dict[str, float | None]
    refused: dict[str, str]
    integrals: dict[str, DeficiencyIntegral]

    def limit(self, load: str, one: StepResponse, check: StepResponse | None) -> None:
        """``C_j`` per unit step."""
        name = f"{load}_{one.kind}"
        self.values[name], self.spreads[name] = _limit(load, one, check)

    def lag(self, load: str, one: StepResponse, check: StepResponse | None, noise: float) -> None:
        """``C_jd`` of the rate of incidence, or why there is none."""
        name = f"{load}_{one.kind}dot"
        try:
            self.integrals[load] = one.integral(load, noise=noise)
            self.values[name], self.spreads[name] = _lag(load, self.integrals[load], one, check, noise)
        except (InputError, NoLimitError) as error:
            self.refused[name] = str(error)

    def sum(self, rate: str, lag: str) -> None:
        """Both together, as an oscillation in attitude has them."""
        name = f"{rate}+{lag}"
        if lag in self.refused:
            self.refused[name] = f"no {lag}"
            return
        self.values[name] = self.values[rate] + self.values[lag]
        self.spreads[name] = _together(self.spreads[rate], self.spreads[lag])

    def result(self, one: StepResponse) -> IndicialResult:
        """With the step's condition and reference."""
        return IndicialResult(
            self.values, self.spreads, self.refused, self.integrals, one.amplitude, one.condition, one.reference
        )


def _limit(name: str, one: StepResponse, check: StepResponse | None) -> tuple[float, float | None]:
    value, spread = one.limit(name)
    change = None if check is None else abs(check.limit(name)[0] - value)
    return value, _together(spread, change)


def _lag(
    name: str, integral: DeficiencyIntegral, one: StepResponse, check: StepResponse | None, noise: float
) -> tuple[float, float]:
    """``C_jad`` per alphadot as the reference normalises rates; Eq. (17) gives it per ``alphadot c/2U``.

    betadot is made dimensionless by the length of the other lateral rates.
    """
    scale = 1.0 if one.reference.rate_normalisation == "c/2V" else 0.5
    if one.kind == "beta":
        lengths = one.reference.moment_lengths
        scale *= float(lengths[1] / lengths[2])
    change = 0.0 if check is None else check.integral(name, noise=noise).value - integral.value
    return scale * integral.incidence_rate_derivative, scale * float(np.hypot(integral.uncertainty, change))


def _together(*spreads: float | None) -> float | None:
    known = [spread for spread in spreads if spread is not None]
    return float(np.linalg.norm(known)) if known else None


def _same_times(one: StepResponse, other: StepResponse) -> None:
    if one.kind != other.kind or one.s.shape != other.s.shape or not np.allclose(one.s, other.s):
        raise InputError("the two step responses must be to the same variable, at the same reduced times")


def _index(name: str) -> int:
    if name not in COEFFICIENTS:
        raise InputError(f"no coefficient {name!r}; there are {', '.join(COEFFICIENTS)}")
    return COEFFICIENTS.index(name)
