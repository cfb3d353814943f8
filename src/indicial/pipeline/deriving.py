"""The derive stages: the methods, side by side on one pool of CFD experiments."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, Protocol, TypeVar, runtime_checkable

from indicial.conventions import COEFFICIENTS
from indicial.derivatives import Derivative, DerivativeTable
from indicial.history import History
from indicial.methods import forced_oscillation, indicial_response, moving_frame, operator
from indicial.motion import FlightCondition, Rates
from indicial.pipeline.context import Context, Outcome
from indicial.pipeline.pool import ExperimentPool
from indicial.pipeline.progress import Tally
from indicial.report.space import FlowPicture
from indicial.solver import SteadyLoads

METHODS = ("mrf", "operator", "fom", "irm")

# Cost of a steady state in time steps of an unsteady run, for the progress bar.
_STEADY_COST = 25.0

# Cost of one solution of the linearised flow, likewise, and how many a projected model takes.
_SOLVE_COST = 1.0
_PROJECTION_SOLVES = 30

T = TypeVar("T")


@runtime_checkable
class MakesPictures(Protocol):
    """A factory that can show the steady flow."""

    def picture(self, condition: FlightCondition) -> FlowPicture:
        """Pressure and Mach number at a condition already solved."""
        ...


def derive(context: Context, methods: Iterable[str]) -> dict[str, Outcome]:
    """Run the methods, all at once, and read them; experiments that are kept are not run again."""
    wanted = tuple(methods)
    case = context.case
    tally = Tally(context.reporter, _expected(context, wanted), _weights(context))
    factory = context.make_factory(case, context.folder)
    performers = {
        "mrf": _moving_frame,
        "fom": _forced_oscillation,
        "irm": _indicial_response,
        "operator": _linearised_flow,
    }
    # The pool is closed first: on an error it ends its workers, and with them what the threads wait for.
    with (
        ThreadPoolExecutor(32) as threads,
        ExperimentPool(factory, case.reference_quantities, context.folder.experiments, context.workers, tally) as pool,
    ):
        # All else starts from the steady state of the condition; the rolling whole model is another mesh.
        base = threads.submit(pool.steady, case.flight_condition)
        if "mrf" in wanted:
            rolling = _rolling(context)[1]
            threads.submit(pool.steady, rolling.condition, rolling.rates)
        base.result()
        longest_first = [method for method in reversed(METHODS) if method in wanted]
        running = {method: threads.submit(performers[method], context, pool, threads) for method in longest_first}
        outcomes = {method: running[method].result() for method in wanted}
    if isinstance(factory, MakesPictures) and not (context.folder.path / "flow.npz").is_file():
        factory.picture(case.flight_condition).save(context.folder.path / "flow.npz")
    return outcomes


def _expected(context: Context, methods: tuple[str, ...]) -> float:
    steps = _weights(context)
    steady = {"mrf": 11, "fom": 1, "irm": 5, "operator": 1}
    unsteady = {
        "mrf": 0.0,
        "fom": 2.0 * steps["pitch oscillation"] + steps["plunge oscillation"],
        "irm": 2.0 * steps["alpha step"] + 2.0 * steps["pitch rate step"],
        "operator": steps["frequency response"] + (steps["projection"] if context.case.operator.k_max else 0.0),
    }
    return sum(_STEADY_COST * steady[m] + unsteady[m] for m in methods)


def _weights(context: Context) -> dict[str, float]:
    """Cost of each kind of experiment, in time steps, by the start of its label."""
    fom = context.case.forced_oscillation
    oscillation = float(fom.periods * fom.steps_per_period)
    step = float(_step_instants(context).size)
    return {
        "pitch oscillation": oscillation,
        "plunge oscillation": oscillation,
        "alpha step": step,
        "pitch rate step": step,
        "steady": _STEADY_COST,
        "frequency response": _SOLVE_COST * len(context.case.operator.inputs) * (2 + len(_frequencies(context))),
        "projection": _SOLVE_COST * _PROJECTION_SOLVES,
    }


def _rolling(context: Context) -> tuple[moving_frame.Experiment, ...]:
    """The base, and the whole model in roll; by mirror symmetry the opposite roll has the opposite moment."""
    case = context.case
    return moving_frame.experiments(
        case.flight_condition,
        case.reference_quantities,
        ("p",),
        amplitudes={"p": case.moving_frame.roll_rate},
        second=case.moving_frame.second_factor,
        one_sided=True,
    )


def _moving_frame(context: Context, pool: ExperimentPool, threads: ThreadPoolExecutor) -> Outcome:
    settings = context.case.moving_frame
    pitching = moving_frame.experiments(
        context.case.flight_condition,
        context.case.reference_quantities,
        ("alpha", "q"),
        amplitudes={"alpha": math.radians(settings.alpha_amplitude_deg), "q": settings.pitch_rate},
        second=settings.second_factor,
    )
    rolling = _rolling(context)
    wanted = {one.label: one for one in (*pitching, *rolling)}
    loads = _all(threads, {label: _steady(pool, one.condition, one.rates) for label, one in wanted.items()})
    pitch, roll = moving_frame.read(pitching, loads), moving_frame.read(rolling, loads)
    table = pitch.derivatives() + roll.derivatives().select(name="Cl_p")
    linearity = [
        {"method": "mrf", "name": name, "what": f"amplitude times {settings.second_factor:g}", "change": change}
        for result in (pitch, roll)
        for name in result.changes
        if name.startswith(("CN", "Cm", "Cl_p")) and (change := result.linearity(name)) is not None
    ]
    return Outcome(
        {"derivatives": table.to_records(), "linearity": linearity, "convergence": pitch.convergence},
        _values(table, ("CN_alpha", "Cm_alpha", "Cm_q", "Cl_p")),
    )


def _forced_oscillation(context: Context, pool: ExperimentPool, threads: ThreadPoolExecutor) -> Outcome:
    case, settings = context.case, context.case.forced_oscillation

    def oscillate(motion: forced_oscillation.OscillationMotion, factor: float = 1.0) -> Callable[[], History]:
        return lambda: forced_oscillation.run(
            pool,
            case.flight_condition,
            math.radians(factor * settings.amplitude_deg),
            settings.k,
            motion,
            periods=settings.periods,
            steps_per_period=settings.steps_per_period,
        )

    larger = oscillate("pitch", settings.second_factor)
    histories = _all(threads, {"pitch": oscillate("pitch"), "plunge": oscillate("plunge"), "pitch_larger": larger})
    for motion, history in histories.items():
        history.to_netcdf(context.folder.histories / f"fom_{motion}.nc")
    reductions = (forced_oscillation.phase_angle, forced_oscillation.regression, forced_oscillation.fourier)
    records = DerivativeTable()
    for reduce in reductions:
        pitch, plunge = reduce(histories["pitch"]), reduce(histories["plunge"])
        sums, lags = pitch.derivatives("pitching oscillation"), plunge.derivatives("plunging oscillation")
        # C_jalpha is read from the plunge: in pitch it is mixed with k^2 C_jqdot (Eq. 3).
        kept = [r for r in sums if not r.name.endswith("_alpha")]
        records = records + kept + lags + _differences(sums, lags)
    last = forced_oscillation.fourier(histories["pitch"])
    ellipses = {
        motion: {
            name: [reading.value(name, "in_phase"), reading.value(name)] for name in forced_oscillation.DERIVATIVES
        }
        for motion, reading in ((m, forced_oscillation.fourier(histories[m])) for m in ("pitch", "plunge"))
    }
    doubled = forced_oscillation.fourier(histories["pitch_larger"])
    linearity = [
        {
            "method": "fom",
            "name": f"{name}_q+{name}_alphadot",
            "what": f"amplitude times {settings.second_factor:g}",
            "change": doubled.value(name) / last.value(name) - 1.0,
        }
        for name in forced_oscillation.DERIVATIVES
    ]
    periodicity = None if last.periodicity is None else last.periodicity.tolist()
    return Outcome(
        {"derivatives": records.to_records(), "ellipses": ellipses, "periodicity": periodicity, "linearity": linearity},
        _values(records.select(reduction="fourier"), ("Cm_q+Cm_alphadot", "Cm_alphadot")),
    )


def _differences(sums: DerivativeTable, lags: DerivativeTable) -> list[Derivative]:
    """``C_q``: the out-of-phase part in pitch less that in plunge."""
    made = []
    for name in forced_oscillation.DERIVATIVES:
        total, lag = sums.one(f"{name}_q+{name}_alphadot"), lags.one(f"{name}_alphadot")
        parts = [u for u in (total.uncertainty, lag.uncertainty) if u is not None]
        made.append(
            replace(
                total,
                name=f"{name}_q",
                value=total.value - lag.value,
                uncertainty=math.hypot(*parts) if len(parts) == 2 else None,
                source="pitching less plunging oscillation",
            )
        )
    return made


def _step_instants(context: Context) -> Any:
    """Instants of the step responses, reduced time."""
    settings = context.case.indicial_response
    return indicial_response.step_times(settings.first_step, settings.growth, settings.last_step, settings.duration)


def _indicial_response(context: Context, pool: ExperimentPool, threads: ThreadPoolExecutor) -> Outcome:
    case, settings = context.case, context.case.indicial_response
    instants = _step_instants(context)
    alpha = math.radians(settings.alpha_amplitude_deg)
    steps: dict[str, tuple[indicial_response.StepKind, float]] = {
        "alpha": ("alpha", alpha),
        "alpha_larger": ("alpha", settings.second_factor * alpha),
        "q": ("q", settings.pitch_rate),
        "q_larger": ("q", settings.second_factor * settings.pitch_rate),
    }

    def respond(kind: indicial_response.StepKind, size: float) -> Callable[[], indicial_response.StepResponse]:
        def perform() -> indicial_response.StepResponse:
            step = indicial_response.experiment(case.flight_condition, case.reference_quantities, size, kind)
            final = threads.submit(pool.steady, *indicial_response.after(step))
            history = indicial_response.run(pool, case.flight_condition, size, instants, kind)
            history.to_netcdf(context.folder.histories / f"irm_{label[kind, size]}.nc")
            return indicial_response.read(history, final.result())

        return perform

    label = {step: name for name, step in steps.items()}
    responses = _all(threads, {name: respond(*step) for name, step in steps.items()})
    checks = {cause: responses[f"{cause}_larger"] for cause in ("alpha", "q")}
    result = indicial_response.derive(
        responses["alpha"], responses["q"], alpha_check=checks["alpha"], q_check=checks["q"]
    )
    linearity = [
        {
            "method": "irm",
            "name": f"{name}_{cause}(s)",
            "what": f"amplitude times {settings.second_factor:g}",
            "change": change,
        }
        for cause, check in checks.items()
        for name, change in indicial_response.linearity(responses[cause], check).items()
        if name in indicial_response.LOADS
    ]
    finals = {
        cause: {name: result.values[f"{name}_{cause}"] for name in indicial_response.LOADS} for cause in ("alpha", "q")
    }
    # what the marches themselves end at: the finals above are those of steady runs
    ends = {
        cause: {
            name: float(responses[cause].response[-1, COEFFICIENTS.index(name)]) for name in indicial_response.LOADS
        }
        for cause in ("alpha", "q")
    }
    tails = {name: integral.reason for name, integral in result.integrals.items()}
    table = result.derivatives()
    return Outcome(
        {
            "derivatives": table.to_records(),
            "refused": result.refused,
            "linearity": linearity,
            "finals": finals,
            "ends": ends,
            "tails": tails,
        },
        _values(table, ("CN_alpha", "Cm_alphadot", "Cm_q")) + "".join(f", {name} refused" for name in result.refused),
    )


def _frequencies(context: Context) -> list[float]:
    """Those of the case, and the forced oscillation's, where the two methods must agree."""
    return sorted({*context.case.operator.k, context.case.forced_oscillation.k})


def _linearised_flow(context: Context, pool: ExperimentPool, threads: ThreadPoolExecutor) -> Outcome:
    case, settings = context.case, context.case.operator
    condition, k = case.flight_condition, _frequencies(context)
    answer = threads.submit(operator.run, pool, condition, k, tuple(settings.inputs))
    projected = None
    if settings.k_max > 0.0:
        projected = threads.submit(pool.projection, condition, settings.k_max, settings.tolerance).result()
        projected.model.to_json(context.folder.projected_model)
    response = answer.result()
    response.to_netcdf(context.folder.frequency_response)
    table = operator.derivatives(response)
    return Outcome(
        {
            "derivatives": table.to_records(),
            "k": k,
            "refused": operator.refusals(response),
            "provenance": response.provenance,
            "projection": None if projected is None else {"order": projected.model.order, **projected.facts},
        },
        _values(table.select(k=None), ("CN_alpha", "Cm_alphadot", "Cm_q", "Cl_p")),
    )


def _steady(pool: ExperimentPool, condition: FlightCondition, rates: Rates) -> Callable[[], SteadyLoads]:
    return lambda: pool.steady(condition, rates)


def _all(threads: ThreadPoolExecutor, calls: dict[str, Callable[[], T]]) -> dict[str, T]:
    """Results of calls made side by side."""
    running = {name: threads.submit(call) for name, call in calls.items()}
    return {name: future.result() for name, future in running.items()}


def _values(table: DerivativeTable, names: tuple[str, ...]) -> str:
    return ", ".join(f"{r.name} {r.value:.4g}" for r in table if r.name in names)
