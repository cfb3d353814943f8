"""The stages in order: what each needs, what its results depend on, and who performs it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from threadpoolctl import threadpool_limits

from indicial.case import Case
from indicial.errors import InputError
from indicial.pipeline.context import Context, FactoryMaker, Outcome
from indicial.pipeline.folder import RunFolder, digest
from indicial.pipeline.progress import LogReporter, Reporter


@dataclass(frozen=True)
class Stage:
    """One stage.

    Parameters
    ----------
    name : str
    title : str
        For the terminal.
    needs : tuple of str
        Stages whose results it reads.
    sections : tuple of str
        Tables of the case file that its own results depend on.
    performer : str
        ``module:function`` in this package; loaded only when it is needed, so that the command line starts at once.
    """

    name: str
    title: str
    needs: tuple[str, ...]
    sections: tuple[str, ...]
    performer: str


_CFD = ("condition", "reference", "flow")

_LIST = (
    Stage("mesh", "Mesh", (), ("shape", "mesh", "condition"), "meshing:make_meshes"),
    Stage("mrf", "Moving frame (MRF)", ("mesh",), (*_CFD, "moving_frame"), "deriving:derive"),
    Stage("fom", "Forced oscillation (FOM)", ("mesh",), (*_CFD, "forced_oscillation"), "deriving:derive"),
    Stage("irm", "Indicial response (IRM)", ("mesh",), (*_CFD, "indicial_response"), "deriving:derive"),
    Stage(
        "operator",
        "Linearised flow (operator)",
        ("mesh",),
        (*_CFD, "operator", "forced_oscillation"),
        "deriving:derive",
    ),
    Stage("rom", "Reduced-order model", ("fom", "irm", "operator"), ("rom", "forced_oscillation"), "reducing:reduce"),
    Stage("fly", "Flights and damping", ("mrf", "irm", "rom"), ("vehicle", "flight"), "flying:fly_twice"),
    Stage("identify", "Identification", ("fly",), ("range",), "identifying:identify_flight"),
    Stage(
        "compare",
        "Comparison",
        ("mrf", "fom", "irm", "operator", "rom", "fly", "identify"),
        ("title", "comparison"),
        "comparing:compare",
    ),
    Stage("report", "Figures and report", ("compare",), ("title",), "reporting:write_report"),
)
STAGES = {stage.name: stage for stage in _LIST}
ALL_STAGES = tuple(STAGES)
DERIVING = tuple(stage.name for stage in _LIST if stage.performer == "deriving:derive")


def stage_key(case: Case, name: str) -> str:
    """What the results of a stage depend on: its part of the case, the package's version, and its needs' keys."""
    stage = STAGES[name]
    content = case.model_dump(mode="json")
    return digest(name, [content[section] for section in stage.sections], [stage_key(case, n) for n in stage.needs])


def run_stages(
    case: Case,
    folder: RunFolder,
    stages: tuple[str, ...] = ALL_STAGES,
    *,
    workers: int | None = None,
    reporter: Reporter | None = None,
    resume: bool = True,
    make_factory: FactoryMaker | None = None,
) -> None:
    """Perform stages in order.

    Parameters
    ----------
    case : Case
    folder : RunFolder
        Where results are read and written.
    stages : tuple of str
        Of `ALL_STAGES`.
    workers : int, optional
        Processes that share the CFD; the case's if not given.
    reporter : Reporter, optional
        Told about progress; the log if not given.
    resume : bool
        Leave out stages whose kept results still belong to the case. CFD experiments are kept in any case.
    make_factory : callable, optional
        Makes the solver's factory: a `SolverFactory` of the finite-volume solver if not given.

    Raises
    ------
    InputError
        If a stage is unknown, or reads results that are not there.
    DivergenceError
        If the flow solver fails.
    """
    unknown = [name for name in stages if name not in STAGES]
    if unknown:
        raise InputError(f"no stage {unknown[0]!r}; there are {', '.join(ALL_STAGES)}")
    reporter = LogReporter() if reporter is None else reporter
    count = case.run.workers if workers is None else workers
    context = Context(case, folder, count, reporter, make_factory or finite_volume)
    _require(context, stages)
    folder.keep_case()
    due = [s for s in stages if not (resume and folder.is_fresh(s, stage_key(case, s)))]
    methods = tuple(s for s in due if s in DERIVING)
    if methods and make_factory is None:
        _timed(reporter, "Compile kernels", lambda: _compiled(reporter))
    for name in stages:
        if name not in due:
            reporter.start(STAGES[name].title)
            reporter.finish(0.0, "kept from an earlier run")
        elif name not in methods:
            perform = _load(STAGES[name].performer)
            folder.forget(name)
            # Matrices are small here: threads of BLAS would only wait for one another.
            with threadpool_limits(limits=1, user_api="blas"):
                outcome, seconds = _timed(reporter, STAGES[name].title, lambda p=perform: p(context))  # type: ignore[misc]
            folder.write(name, stage_key(case, name), seconds, outcome.results)
        elif name == methods[0]:
            _derive(context, methods)


def _require(context: Context, stages: tuple[str, ...]) -> None:
    """Say now what a stage will miss: results that are neither kept nor about to be made."""
    for name in stages:
        for need in STAGES[name].needs:
            if need not in stages:
                record = context.folder.read(need)
                if record["key"] != stage_key(context.case, need):
                    raise InputError(
                        f"{context.folder.path}: the results of {need!r} belong to another case or version; "
                        f"run `indicial {'derive' if need in DERIVING else need}` again before {name!r}"
                    )


def _derive(context: Context, methods: tuple[str, ...]) -> None:
    """The methods side by side, as one stage on the terminal."""
    from indicial.pipeline.deriving import derive

    for name in methods:
        context.folder.forget(name)
    title = f"CFD: {', '.join(methods).upper()}"
    context.reporter.start(title)
    begun = time.monotonic()
    outcomes = derive(context, methods)
    seconds = time.monotonic() - begun
    for name, outcome in outcomes.items():
        context.folder.write(name, stage_key(context.case, name), seconds, outcome.results)
    context.reporter.finish(seconds, "; ".join(f"{name.upper()} {o.summary}" for name, o in outcomes.items()))


def _timed(reporter: Reporter, title: str, perform: Callable[[], Outcome]) -> tuple[Outcome, float]:
    reporter.start(title)
    begun = time.monotonic()
    outcome = perform()
    seconds = time.monotonic() - begun
    reporter.finish(seconds, outcome.summary)
    return outcome, seconds


def _load(performer: str) -> Callable[[Context], Outcome]:
    module, _, function = performer.partition(":")
    loaded: Callable[[Context], Outcome] = getattr(import_module(f"indicial.pipeline.{module}"), function)
    return loaded


def _compiled(reporter: Reporter) -> Outcome:
    reporter.update(0.0, "the first run compiles, later ones load from the cache")
    from indicial.pipeline.finite_volume import compile_kernels

    compile_kernels()
    return Outcome({}, "kernels are in numba's cache")


def finite_volume(case: Case, folder: RunFolder) -> Any:
    """The factory of the finite-volume solver of a run."""
    from indicial.cfd import FlowSettings
    from indicial.pipeline.finite_volume import FiniteVolumeFactory

    return FiniteVolumeFactory(
        half=folder.mesh(whole=False),
        whole=folder.mesh(whole=True),
        mesh_key=stage_key(case, "mesh"),
        states=folder.states,
        condition=case.flight_condition,
        reference=case.reference_quantities,
        settings=FlowSettings(
            steady_tolerance=case.flow.steady_tolerance, unsteady_tolerance=case.flow.unsteady_tolerance
        ),
    )
