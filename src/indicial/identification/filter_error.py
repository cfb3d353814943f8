r"""Filter error: maximum likelihood of a flight in turbulence, with a Kalman filter inside.

With innovations nu and their covariance S of the extended Kalman filter (`kalman`), which takes them one channel after
the other as independent errors e with variances s,

    J = 1/2 sum (nu^T S^-1 nu + ln det S) = 1/2 sum (e^2/s + ln s),
    gradient   sum (e e'/s + s'/(2 s) (1 - e^2/s)),         information   sum (e' e'^T/s + s' s'^T/(2 s^2)),

is minimised over parameters of the model, start states, intensities of process noise and deviations of measurement
noise together, by damped scoring steps: Gauss-Newton on the rows ``e'/sqrt(s)`` and ``s'/(sqrt(2) s)``. Where a model
is wrong J bends otherwise than its information says, which is learnt from the gradients on the way (Dennis, Gay &
Welsch, ACM Trans. Math. Softw. 7 (1981) 348). The information is exact for a linear model; its inverse is the
covariance of the estimate. Positive unknowns go by their logarithms.
Derivatives are central differences of a thousandth of a standard error. Without process noise and with a known start
this is output error.

Source: Maine & Iliff, NASA RP-1168 (1986), ch. 9, and SIAM J. Appl. Math. 41 (1981) 558 (both noises at once);
Jategaonkar, "Flight Vehicle System Identification" (2nd ed., 2015), ch. 5.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from indicial.flightsim.signals import Parameters
from indicial.identification.accuracy import cramer_rao, undetermined
from indicial.identification.estimate import Estimate
from indicial.identification.filter_error_fit import FilterErrorFit
from indicial.identification.filter_error_problem import build_problem
from indicial.identification.filtering import FilterResult
from indicial.identification.problem import Parameter
from indicial.identification.record import FlightRecord
from indicial.identification.scoring import Minimum, minimise
from indicial.identification.state_model import StateModel


def filter_error(
    model: StateModel,
    records: Sequence[FlightRecord],
    starts: Sequence[Mapping[str, float]],
    parameters: Sequence[Parameter],
    *,
    start_errors: Mapping[str, float] | None = None,
    free_start: Sequence[str] = (),
    known: Parameters | None = None,
    estimate_noise: bool = True,
) -> FilterErrorFit:
    """Fit a model with process noise to records.

    Parameters
    ----------
    model : StateModel
    records : sequence of FlightRecord
        With the standard deviations of their channels: what holds, or where the estimate starts. Values may be missing.
    starts : sequence of mapping
        Of each record: every state before the first measurement.
    parameters : sequence of Parameter
        Parameters of the model, and ``intensity_STATE``: process noise, positive, in units of the state over sqrt(s).
        ``noise_CHANNEL`` may be given to set a prior.
    start_errors : mapping of str to float
        Standard errors of the starts, what is known of them beforehand; 0 where not given.
    free_start : sequence of str
        States whose starts are unknown constants, in each record its own.
    known : mapping of str to float or Signal, optional
        Parameters of the model that are neither unknown nor inputs of the records.
    estimate_noise : bool
        Whether the standard deviations of all channels are unknown, common to all records.

    Raises
    ------
    InputError
        If a name is unknown, a channel dead, a parameter without effect.
    DivergenceError
        If the fit does not converge, or the filter breaks down at the start.
    """
    problem = build_problem(
        model, records, starts, parameters, start_errors or {}, free_start, known or {}, estimate_noise
    )
    return _result(minimise(problem), {p.name: p.start for p in parameters})


def _result(found: Minimum, starts: Mapping[str, float]) -> FilterErrorFit:
    problem, values = found.problem, found.problem.values(found.at)
    scale = np.where([u.logarithmic for u in problem.unknowns], values, 1.0)
    covariance = cramer_rao(found.slopes) * np.outer(scale, scale)
    errors = np.sqrt(np.diag(covariance))
    filters = []
    for k in range(len(problem.inputs)):
        given = problem.filled(found.at, k)
        model = replace(given.model, intensity=given.intensity)
        filters.append(FilterResult(model, given.time, given.run()[1], "extended"))
    own = [j for j, u in enumerate(problem.unknowns) if u.kind == "parameter"]
    names = tuple(problem.unknowns[j].name for j in own)
    findings = undetermined(names, values[own], covariance[np.ix_(own, own)]) if own else ()
    return FilterErrorFit(
        estimates=tuple(
            Estimate(u.name, float(v), float(e)) for u, v, e in zip(problem.unknowns, values, errors, strict=True)
        ),
        covariance=covariance,
        findings=(*findings, *(f"the records show no {name}" for name in found.unseen)),
        filters=tuple(filters),
        measured=tuple(given.measured for given in problem.inputs),
        starts=dict(starts),
        cost=found.cost,
    )
