r"""Profile likelihoods: intervals where the Cramer-Rao bound is not to be trusted.

With all other unknowns at their best for each value of one, ``D(v) = 2 (J(v) - J_min)`` is chi-squared of one degree of
freedom at the true value, whatever the unknown is called or scaled, and the interval of level gamma is where D is below
its quantile. The bound is the parabola of the same curvature at the best fit: it agrees where the model is linear in
the unknown as far as the interval goes. The noise is that of the fit. Source: Venzon & Moolgavkar, Appl. Stat. 37
(1988) 87; Raue et al., Bioinformatics 25 (2009) 1923.

Where the fit was at a local minimum D is below 0 somewhere. Such values belong to the interval, which is then as wide
as the true one or wider, as J is counted from too high a level.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.identification.fit import OutputErrorFit
from indicial.identification.maximum_likelihood import Noise, Problem, minimise
from indicial.identification.problem import Manoeuvre, Parameter

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_APART = 0.1  # of the bound's half width: from here on profile and bound are said to differ
_FARTHEST = 20.0  # standard errors looked at; an interval that reaches farther is open
_CLOSE = 0.01  # of the square root of D at an end
_TRIALS = 25
_LOWER = 1e-2  # of D; by this much below the fit's J says that the fit was not at its least


@dataclass(frozen=True)
class Profile:
    """The profile likelihood of one unknown.

    Parameters
    ----------
    name : str
    estimate, standard_error : float
        Of the fit.
    level : float
        Of the interval.
    lower, upper : float
        Its ends; infinite where the likelihood does not fall enough within 20 standard errors, or where fits cease to
        converge before it has. The lower end of a positive parameter is 0 at least.
    values, statistic : ndarray
        Points looked at, and D there, in order, shape (n,).
    better : mapping
        Values of all unknowns where J is least, if it is less than where the fit ended: the fit was at a local minimum,
        and is best made again from there. Empty otherwise.
    """

    name: str
    estimate: float
    standard_error: float
    level: float
    lower: float
    upper: float
    values: Array
    statistic: Array
    better: Mapping[str, float] = field(default_factory=dict)

    @property
    def bound(self) -> tuple[float, float]:
        """The interval by the Cramer-Rao bound."""
        half = math.sqrt(_quantile(self.level)) * self.standard_error
        return self.estimate - half, self.estimate + half

    @property
    def trusts_bound(self) -> bool:
        """Whether the bound's interval has the profile's ends, within a tenth of its half width."""
        half = 0.5 * (self.bound[1] - self.bound[0])
        ends = zip((self.lower, self.upper), self.bound, strict=True)
        return all(abs(mine - its) <= _APART * half for mine, its in ends)

    def summary(self) -> str:
        """The interval, and whether the bound's will do."""
        low, high = self.bound
        word = "the bound agrees" if self.trusts_bound else f"NOT the bound's, {low:.5g} to {high:.5g}"
        text = (
            f"{self.name}: {self.estimate:.5g}, {self.level:.0%} interval {self.lower:.5g} to {self.upper:.5g}; {word}"
        )
        if not self.better:
            return text
        less = -0.5 * float(self.statistic.min())
        return (
            f"{text}; at {self.better[self.name]:.5g} J is {less:.3g} lower: the fit is at a local minimum, fit again "
            "from the values in `better`"
        )

    def plot(self) -> Figure:
        """D over the unknown, the parabola of the bound, and the level."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
        axes.plot(self.values, self.statistic, "o-", ms=4, label="profile")
        fine = np.linspace(self.values[0], self.values[-1], 200)
        axes.plot(fine, ((fine - self.estimate) / self.standard_error) ** 2, "--", label="Cramer-Rao bound")
        limit = _quantile(self.level)
        axes.axhline(limit, color="0.5", linewidth=0.8, label=f"{self.level:.0%}")
        for end in (self.lower, self.upper):
            if math.isfinite(end):
                axes.axvline(end, color="C0", linewidth=0.8)
        axes.set(xlabel=self.name, ylabel="2 (J - least J)", ylim=(0.0, 2.5 * limit))
        axes.legend(fontsize="small")
        return figure


def profile_likelihood(
    fit: OutputErrorFit,
    parameters: Sequence[Parameter],
    name: str,
    *,
    level: float = 0.95,
    threads: int | None = None,
) -> Profile:
    """The profile likelihood of a parameter of a fit.

    Parameters
    ----------
    fit : OutputErrorFit
    parameters : sequence of Parameter
        Those that `fit_manoeuvres` was given.
    name : str
        One that the records have in common.
    level : float
    threads : int, optional
        As `fit_manoeuvres`.

    Raises
    ------
    InputError
        If there is no such parameter, it has a value for each record or a prior, or the level is none.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"level is {level}, must be between 0 and 1")
    chosen = next((p for p in parameters if p.name == name), None)
    if chosen is None:
        raise InputError(f"no parameter {name!r} to profile; there are {', '.join(p.name for p in parameters)}")
    if chosen.per_record or chosen.prior is not None:
        raise InputError(f"{name} has {'a value for each record' if chosen.per_record else 'a prior'}: profile another")
    best = fit[name]
    walk = _Walk(fit, [p for p in parameters if p.name != name], chosen, threads)
    with threadpool_limits(limits=1, user_api="blas"):
        ends = [walk.end(sign, math.sqrt(_quantile(level)), best.standard_error) for sign in (-1.0, 1.0)]
    seen = sorted(walk.seen.items())
    return Profile(
        name,
        best.value,
        best.standard_error,
        level,
        ends[0],
        ends[1],
        np.array([v for v, _ in seen]),
        np.array([d for _, d in seen]),
        walk.better,
    )


class _Walk:
    """Fits with one parameter held, from value to value."""

    def __init__(
        self, fit: OutputErrorFit, others: Sequence[Parameter], chosen: Parameter, threads: int | None
    ) -> None:
        self.fit, self.others, self.chosen, self.threads = fit, others, chosen, threads
        self.noise = Noise(fit.noise, fit.memory)
        self.start = {e.name: e.value for e in (*fit.parameters, *fit.start_values)}
        self.centre = self.start[chosen.name]
        self.least, _ = self._held(self.centre)
        self.seen = {self.centre: 0.0}
        self.better: dict[str, float] = {}

    def statistic(self, value: float) -> float:
        """D at a value; infinite where no fit converges."""
        if value not in self.seen:
            try:
                cost, others = self._held(value)
            except DivergenceError:
                return math.inf
            found = 2.0 * (cost - self.least)
            if found < min(-_LOWER, *self.seen.values()):
                self.better = {**others, self.chosen.name: value}
            self.seen[value] = found
        return self.seen[value]

    def end(self, sign: float, wanted: float, error: float) -> float:
        """Where the square root of D is `wanted`, on one side: bracketed, then by false position on the root."""

        def root(away: float) -> float:
            return math.sqrt(max(self.statistic(self.centre + sign * away * error), 0.0))

        wall = self.centre / error if self.chosen.positive and sign < 0.0 else math.inf
        farthest = min(_FARTHEST, (1.0 - _CLOSE) * wall)
        inside, inner = 0.0, 0.0
        outside = min(1.1 * wanted, farthest)
        while (outer := root(outside)) < wanted:
            if outside >= farthest:
                return 0.0 if farthest < _FARTHEST else sign * math.inf
            inside, inner = outside, outer
            outside = min(1.6 * outside, farthest)
        for _ in range(_TRIALS):
            share = (wanted - inner) / (outer - inner) if math.isfinite(outer) else 0.5
            trial = inside + min(max(share, 0.05), 0.95) * (outside - inside)
            found = root(trial)
            if abs(found - wanted) < _CLOSE * wanted:
                return self.centre + sign * trial * error
            if found < wanted:
                inside, inner = trial, found
            else:
                outside, outer = trial, found
        return self.centre + sign * outside * error if math.isfinite(outer) else sign * math.inf

    def _held(self, value: float) -> tuple[float, dict[str, float]]:
        """Least J with the parameter held, and the others there; begins where the fit ended."""
        held = [_knowing(m, self.chosen.name, value) for m in self.fit.manoeuvres]
        problem = Problem(held, self.others, self.threads)
        problem.start = np.array([self.start.get(n, problem.start[i]) for i, n in enumerate(problem.names)])
        seams = tuple(np.zeros((0, m.node_states.shape[1])) for m in held)
        point = problem.look(problem.start, None if not any(len(m.node_states) for m in held) else seams)
        if point is None:
            raise DivergenceError("not finite")
        cost: list[float] = []
        end = minimise(problem, point, self.noise, cost)
        return cost[-1], dict(zip(problem.names, end.unknowns.tolist(), strict=True))


def _knowing(manoeuvre: Manoeuvre, name: str, value: float) -> Manoeuvre:
    single = replace(manoeuvre, nodes=manoeuvre.nodes[:0], node_states=manoeuvre.node_states[:0])
    if name not in manoeuvre.model.parameter_names:
        return single
    return replace(single, known={**manoeuvre.known, name: value})


def _quantile(level: float) -> float:
    from scipy.stats import chi2

    return float(chi2.ppf(level, 1))
