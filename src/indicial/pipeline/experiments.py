"""What can be asked of a solver: a steady state, a history under a motion, a frequency response, a projected model.

Each kind says what its result depends on, what it is called, and how a worker process performs it into a file.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.files import sources_digest, write_text
from indicial.motion import FlightCondition, Motion, Rates, SteadyMotion
from indicial.rom import Projection, StateSpaceModel, project
from indicial.solver import FrequencySolver, LinearisedFlow, Solver

if TYPE_CHECKING:
    from indicial.cfd import ConvergenceHistory


@runtime_checkable
class TellsConvergence(Protocol):
    """A solver that can show how a steady state converged."""

    def convergence(self, condition: FlightCondition, rates: Rates = ...) -> ConvergenceHistory:
        """Residual, pseudo-time step and work, step by step."""
        ...


@runtime_checkable
class Linearises(Protocol):
    """A solver that can be linearised about a steady state."""

    def linearise(self, condition: FlightCondition) -> tuple[LinearisedFlow, ...]:
        """One flow, or several that share the inputs among them."""
        ...


class Experiment(ABC):
    """One thing to ask a solver."""

    suffix: ClassVar[str]

    @property
    @abstractmethod
    def label(self) -> str:
        """What it is, for progress, errors and the file's name."""

    @property
    @abstractmethod
    def whole(self) -> bool:
        """Whether it takes the whole model; else the half will do, whose mirror image is the rest."""

    @abstractmethod
    def depends_on(self) -> Iterator[Any]:
        """All that its result depends on beside the solver: plain values, and bytes of arrays."""

    @abstractmethod
    def perform(self, solver: Solver, path: Path) -> None:
        """Ask, and write the answer in one step."""

    def key(self, factory_key: str) -> str:
        """Another one for every other result."""
        parts = (sources_digest("indicial.cfd"), factory_key, type(self).__name__, *self.depends_on())
        return hashlib.sha256(repr(parts).encode()).hexdigest()

    def file_name(self, key: str) -> str:
        """Name of its result file: what it is, and the start of its key."""
        slug = re.sub(r"[^a-z0-9.+-]+", "_", self.label.lower()).strip("_")
        return f"{slug}-{key[:8]}.{self.suffix}"


@dataclass(frozen=True)
class SteadyExperiment(Experiment):
    """Loads of a steady state, and how it converged; JSON."""

    condition: FlightCondition
    rates: Rates
    suffix = "json"

    @property
    def label(self) -> str:
        """Angle of attack and rates."""
        return _label(self.condition, SteadyMotion(self.condition, self.rates), steady=True)

    @property
    def whole(self) -> bool:
        """Roll, yaw and sideslip take the whole model."""
        return any(rate != 0.0 for rate in (self.condition.beta, self.rates.p, self.rates.r))

    def depends_on(self) -> Iterator[Any]:
        """Condition and rates."""
        yield from (asdict(self.condition), self.rates.as_array().tobytes())

    def perform(self, solver: Solver, path: Path) -> None:
        """Solve for the state."""
        loads = solver.steady(self.condition, self.rates)
        content: dict[str, Any] = {
            "experiment": self.label,
            "coefficients": loads.coefficients.tolist(),
            "convergence": loads.convergence,
        }
        if isinstance(solver, TellsConvergence):
            history = solver.convergence(self.condition, self.rates)
            content["history"] = {name: values.tolist() for name, values in history.to_arrays().items()}
        write_text(path, json.dumps(content, indent=1))


@dataclass(frozen=True)
class UnsteadyExperiment(Experiment):
    """Loads at `times` [s] under a motion; netCDF."""

    condition: FlightCondition
    motion: Motion
    times: Array
    suffix = "nc"

    @property
    def label(self) -> str:
        """The motion and its size."""
        return _label(self.condition, self.motion, steady=False)

    @property
    def whole(self) -> bool:
        """Roll, yaw and sideslip take the whole model."""
        velocity, rate, velocity_before, rate_before = self._moves()
        lateral = (velocity[:, 1], rate[:, 0], rate[:, 2], velocity_before[1:2], rate_before[[0, 2]])
        return any(bool(np.any(component != 0.0)) for component in lateral)

    def depends_on(self) -> Iterator[Any]:
        """Condition, instants, and the motion at them."""
        yield asdict(self.condition)
        yield from (np.ascontiguousarray(array).tobytes() for array in (self.times, *self._moves()))

    def perform(self, solver: Solver, path: Path) -> None:
        """March."""
        solver.unsteady(self.condition, self.motion, self.times).to_netcdf(path)

    def _moves(self) -> tuple[Array, Array, Array, Array]:
        motion = self.motion
        return motion.velocity(self.times), motion.rate(self.times), motion.velocity_before, motion.rate_before


@dataclass(frozen=True)
class FrequencyExperiment(Experiment):
    """H(ik) of the flow linearised about a steady state; netCDF."""

    condition: FlightCondition
    k: tuple[float, ...]
    inputs: tuple[str, ...] | None
    suffix = "nc"

    @property
    def label(self) -> str:
        """Inputs and number of frequencies."""
        return f"frequency response to {', '.join(self.inputs or ('all inputs',))} at {len(self.k)} k"

    @property
    def whole(self) -> bool:
        """The half answers to lateral inputs too; about a state with sideslip there is no half."""
        return self.condition.beta != 0.0

    def depends_on(self) -> Iterator[Any]:
        """Condition, frequencies and inputs."""
        yield from (asdict(self.condition), self.k, self.inputs)

    def perform(self, solver: Solver, path: Path) -> None:
        """Solve for the response."""
        if not isinstance(solver, FrequencySolver):
            raise InputError(f"{type(solver).__name__} has no frequency response: it cannot be linearised")
        solver.frequency_response(self.condition, self.k, self.inputs).to_netcdf(path)


@dataclass(frozen=True)
class KeptProjection:
    """A projected model, and what is told of it.

    Parameters
    ----------
    model : StateSpaceModel
    facts : dict
        Band, errors, solutions taken: plain values, see `indicial.rom.Projection`.
    """

    model: StateSpaceModel
    facts: dict[str, Any]

    @classmethod
    def of(cls, projection: Projection) -> Self:
        """What is kept of a projection."""
        p = projection
        facts = {
            "k_max": p.k_max,
            "tolerance": p.tolerance,
            "met": p.met,
            "estimated_error": p.estimated_error,
            "validated_error": p.validated_error,
            "held_out": [asdict(point) for point in p.held_out],
            "points": p.points.tolist(),
            "forward_solves": p.forward_solves,
            "adjoint_solves": p.adjoint_solves,
            "summary": p.summary(),
        }
        return cls(p.model, facts)

    def to_json(self, path: Path) -> None:
        """Write a JSON file in one step."""
        write_text(path, json.dumps({"model": self.model.to_dict(), "facts": self.facts}, indent=1))

    @classmethod
    def from_json(cls, path: Path) -> Self:
        """Read a file of `to_json`."""
        content = json.loads(path.read_text(encoding="utf-8"))
        return cls(StateSpaceModel.from_dict(content["model"]), content["facts"])


@dataclass(frozen=True)
class ProjectionExperiment(Experiment):
    """A model projected from the linearised flow, from alpha and q; JSON."""

    condition: FlightCondition
    k_max: float
    tolerance: float
    suffix = "json"

    @property
    def label(self) -> str:
        """The band."""
        return f"projection up to k {self.k_max:g}"

    @property
    def whole(self) -> bool:
        """About a state with sideslip there is no half."""
        return self.condition.beta != 0.0

    def depends_on(self) -> Iterator[Any]:
        """Condition, band and tolerance."""
        yield from (asdict(self.condition), self.k_max, self.tolerance)

    def perform(self, solver: Solver, path: Path) -> None:
        """Project."""
        if not isinstance(solver, Linearises):
            raise InputError(f"{type(solver).__name__} cannot be linearised: no model can be projected from it")
        flow = next(flow for flow in solver.linearise(self.condition) if "alpha" in flow.inputs)
        KeptProjection.of(project(flow, self.k_max, self.tolerance)).to_json(path)


def _label(condition: FlightCondition, motion: Motion, steady: bool) -> str:
    described = motion.describe()
    parts = [str(described["kind"]).replace("_", " ")]
    if steady:
        parts.append(f"alpha {math.degrees(condition.alpha):.4g} deg")
    for name, value in described.items():
        if name == "amplitude":
            parts.append(f"{math.degrees(value):+.4g} deg")
        elif name in ("p", "q", "r", "rate_amplitude") and value:
            parts.append(f"{'' if name == 'rate_amplitude' else name + ' '}{value:+.4g} rad/s")
    return " ".join(parts)
