r"""CFD experiments in worker processes, each kept in a file of its own.

`ExperimentPool` is a solver: the methods run on it as on any other. What they ask for (a steady state, a history under
a motion, a frequency response) is looked up among the kept results, and computed by a worker process only if it is not
there. That is how a run resumes, how its experiments share the cores, and how two methods share one result.
"""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import ReferenceQuantities
from indicial.errors import DivergenceError, IndicialError
from indicial.frequency import FrequencyResponse, reduced_frequencies
from indicial.history import History
from indicial.motion import FlightCondition, Motion, Rates
from indicial.pipeline.experiments import (
    Experiment,
    FrequencyExperiment,
    KeptProjection,
    ProjectionExperiment,
    SteadyExperiment,
    UnsteadyExperiment,
)
from indicial.solver import Solver, SteadyLoads

log = logging.getLogger(__name__)

_ABANDONED = 3600.0  # age of a half-written file that nobody is writing any more [s]

Fraction = Callable[[float], None]
"""Told the fraction of one experiment that is done, 0 to 1."""

Watch = Callable[[str, float], None]
"""Told an experiment's label and the fraction of it that is done."""


class SolverFactory(Protocol):
    """Builds solvers in a worker process; must be picklable."""

    def key(self) -> str:
        """What a result depends on beside the motion: mesh, reference, settings."""
        ...

    def build(self, whole: bool, progress: Fraction) -> Solver:
        """A solver on the whole model, or on the half whose mirror image is the rest."""
        ...


class ExperimentPool:
    """A solver whose experiments run in worker processes and are kept in files.

    Safe to call from several threads at once, one for each method: that is what keeps the workers busy.

    Parameters
    ----------
    factory : SolverFactory
    reference : ReferenceQuantities
    folder : Path
        Where results are kept.
    workers : int
        Number of processes.
    watch : callable, optional
        Told label and fraction done of the experiments that run.
    """

    def __init__(
        self,
        factory: SolverFactory,
        reference: ReferenceQuantities,
        folder: Path,
        workers: int,
        watch: Watch | None = None,
    ) -> None:
        self._factory = factory
        self._factory_key = factory.key()
        self._reference = reference
        self._folder = folder
        self._watch = watch
        self._lock = threading.Lock()
        for unfinished in folder.glob(".*"):
            # a file that a run was writing when it was ended, unless another run is writing it now
            if time.time() - unfinished.stat().st_mtime > _ABANDONED:
                unfinished.unlink(missing_ok=True)
        self._futures: dict[str, Future[None]] = {}
        share = max(1, (os.cpu_count() or 1) // workers)
        context = multiprocessing.get_context("spawn")
        self._queue = context.Queue()
        self._executor = ProcessPoolExecutor(workers, context, _start_worker, (factory, self._queue, share))
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown(wait=False, cancel_futures=True)
        if kind is not None:
            # Half-done experiments are not waited for: their checkpoints are on disk.
            for process in multiprocessing.active_children():
                process.terminate()
        self._executor.shutdown(wait=True)
        self._queue.put(None)
        self._listener.join()

    @property
    def reference(self) -> ReferenceQuantities:
        """What the loads are made dimensionless with."""
        return self._reference

    def steady(self, condition: FlightCondition, rates: Rates = Rates()) -> SteadyLoads:
        """Loads of the steady state at constant velocity and body rates; see `indicial.solver.Solver`."""
        content = json.loads(self._result(SteadyExperiment(condition, rates)).read_text(encoding="utf-8"))
        return SteadyLoads(np.array(content["coefficients"]), condition, rates, self._reference, content["convergence"])

    def unsteady(self, condition: FlightCondition, motion: Motion, times: ArrayLike) -> History:
        """Loads at `times` [s] under `motion`; see `indicial.solver.Solver`."""
        instants = np.asarray(times, dtype=float)
        return History.from_netcdf(self._result(UnsteadyExperiment(condition, motion, instants)))

    def frequency_response(
        self, condition: FlightCondition, k: ArrayLike = (), inputs: tuple[str, ...] | None = None
    ) -> FrequencyResponse:
        """H(ik) from motion to loads; see `indicial.solver.FrequencySolver`."""
        ks = tuple(reduced_frequencies(k).tolist())
        return FrequencyResponse.from_netcdf(self._result(FrequencyExperiment(condition, ks, inputs)))

    def projection(self, condition: FlightCondition, k_max: float, tolerance: float) -> KeptProjection:
        """The model projected from the linearised flow over ``0 <= k <= k_max``; see `indicial.rom.project`."""
        return KeptProjection.from_json(self._result(ProjectionExperiment(condition, k_max, tolerance)))

    def _result(self, experiment: Experiment) -> Path:
        """The result file, once it is there."""
        key, label = experiment.key(self._factory_key), experiment.label
        path = self._folder / experiment.file_name(key)
        with self._lock:
            future = self._futures.get(key)
            if future is None and not path.is_file():
                log.info("experiment %s", label)
                future = self._executor.submit(_perform, experiment, path)
                self._futures[key] = future
        if future is not None:
            try:
                future.result()
            except BrokenProcessPool as error:
                raise IndicialError(
                    f"{label}: a worker process was ended from outside (out of memory?); "
                    "run again to resume, with fewer workers or a coarser mesh"
                ) from error
        if self._watch is not None:
            self._watch(label, 1.0)
        return path

    def _listen(self) -> None:
        while (message := self._queue.get()) is not None:
            if self._watch is not None:
                self._watch(*message)


class _Worker:
    """What a worker process holds: its solvers, and the line to the parent."""

    def __init__(self, factory: SolverFactory, queue: Any) -> None:
        self._factory, self._queue = factory, queue
        self._solvers: dict[bool, Solver] = {}
        self._label = ""

    def perform(self, experiment: Experiment, path: Path) -> None:
        self._label = experiment.label
        self._report(0.0)
        try:
            experiment.perform(self._solver(experiment.whole), path)
        except DivergenceError as error:
            raise DivergenceError(f"{experiment.label}: {error}") from error

    def _solver(self, whole: bool) -> Solver:
        if whole not in self._solvers:
            self._solvers[whole] = self._factory.build(whole, self._report)
        return self._solvers[whole]

    def _report(self, fraction: float) -> None:
        self._queue.put((self._label, fraction))


_worker: _Worker | None = None


def _start_worker(factory: SolverFactory, queue: Any, threads: int) -> None:
    """Make the process a worker with its share of the cores."""
    import signal

    import numba
    import threadpoolctl

    numba.set_num_threads(min(threads, numba.get_num_threads()))
    threadpoolctl.threadpool_limits(threads)
    # Ctrl-C is the parent's to handle: it ends the workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    global _worker
    _worker = _Worker(factory, queue)


def _end_with_parent() -> None:
    """A parent that was killed cannot end its workers: they see to it themselves."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _perform(experiment: Experiment, path: Path) -> None:
    assert _worker is not None
    _worker.perform(experiment, path)
