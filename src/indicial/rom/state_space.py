r"""State-space model of unsteady loads in reduced time."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.files import parts_of, read_json, read_netcdf, write_netcdf, write_text
from indicial.motion import FlightCondition
from indicial.rom.modal import ModalForm
from indicial.rom.model import ComplexArray, ReducedModel
from indicial.rom.response import StepResponse, StepResponses
from indicial.rom.signals import MotionInputs
from indicial.rom.simulation import simulate

if TYPE_CHECKING:
    import control
    import xarray
    from matplotlib.figure import Figure

SCHEMA_VERSION = 1
FORMAT = "indicial state-space model"


@dataclass(frozen=True)
class ChannelError:
    """How well a model repeats the step response it was made from.

    Parameters
    ----------
    output, input : str
    rms : float
        Root-mean-square error over the response, relative to that of its deficiency function (its unsteady part).
    peak : float
        Largest error relative to the largest absolute value of the response.
    """

    output: str
    input: str
    rms: float
    peak: float


@dataclass(frozen=True)
class Candidate:
    """One realisation that was tried for one input.

    Parameters
    ----------
    input, method : str
    order : int
        Number of states.
    held_out : float
        RMS error at the samples held out, relative to the deficiency functions.
    chosen : bool
    """

    input: str
    method: str
    order: int
    held_out: float
    chosen: bool = False


@dataclass(frozen=True)
class StateSpaceModel(ReducedModel):
    r"""``dx/ds = A x + B u``, ``C = C_0 + C x + D u`` in reduced time ``s = 2Vt/c``.

    Parameters
    ----------
    a, b, c, d : ndarray
        Shapes (n, n), (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs). D is the response at 0+.
    inputs, outputs : tuple of str
    baseline : ndarray
        (CA, CY, CN, Cl, Cm, Cn) at the condition, shape (6,).
    condition : FlightCondition
    reference : ReferenceQuantities
    method : str
        How it was realised.
    errors : tuple of ChannelError
        Fit residual of each channel.
    candidates : tuple of Candidate
        What was tried, with held-out errors, and what was chosen.
    refused : dict
        Derivatives for which the data give no limit at k -> 0, with the reason, although the model has one.

    Raises
    ------
    InputError
        If shapes do not fit or the system is not stable.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    baseline: Array
    condition: FlightCondition
    reference: ReferenceQuantities
    method: str = "given"
    errors: tuple[ChannelError, ...] = field(default_factory=tuple)
    candidates: tuple[Candidate, ...] = field(default_factory=tuple)
    refused: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n, m, p = len(self.a), len(self.inputs), len(self.outputs)
        shapes = {"a": (n, n), "b": (n, m), "c": (p, n), "d": (p, m), "baseline": (6,)}
        for name, shape in shapes.items():
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != shape or not np.all(np.isfinite(values)):
                raise InputError(f"state-space {name} must be finite and of shape {shape}, is {values.shape}")
            object.__setattr__(self, name, values)
        self._check_names()
        if n and np.max(self.poles.real) >= 0.0:
            raise InputError(f"state-space model is not stable: a pole has real part {np.max(self.poles.real):g}")

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.a)

    @cached_property
    def poles(self) -> ComplexArray:
        """Eigenvalues of A in reduced time, slowest first, shape (n,)."""
        values = np.asarray(np.linalg.eigvals(self.a), dtype=np.complex128)
        return values[np.lexsort((values.imag, -values.real))]

    @cached_property
    def _modes(self) -> ModalForm | None:
        return ModalForm.of(self.a, self.b, self.c, self.d)

    def modes(self) -> ModalForm:
        """The model as first-order recurrences, one for each real pole or conjugate pair.

        Raises
        ------
        InputError
            If poles coincide without an eigenvector each: such a model has no modal form.
        """
        if self._modes is None:
            poles = ", ".join(_pole_text(pole) for pole in self.poles if pole.imag >= 0.0)
            raise InputError(
                f"the model has no modal form: of its poles {poles} some nearly share an eigenvector; "
                "part them a little, or realise the model with another order"
            )
        return self._modes

    @cached_property
    def system(self) -> control.StateSpace:
        """The model as a `control.StateSpace` in reduced time, inputs and outputs named."""
        import control

        return control.ss(self.a, self.b, self.c, self.d, inputs=list(self.inputs), outputs=list(self.outputs))

    @property
    def static_gain(self) -> Array:
        """``D - C A^{-1} B``, shape (n_outputs, n_inputs)."""
        gain: Array = self.d - self.c @ np.linalg.solve(self.a, self.b)
        return gain

    @property
    def rate_gain(self) -> Array:
        """``H'(0) = -C A^{-2} B``, shape (n_outputs, n_inputs)."""
        gain: Array = -self.c @ np.linalg.solve(self.a, np.linalg.solve(self.a, self.b))
        return gain

    def refusals(self) -> dict[str, str]:
        """Derivatives for which the data gave no limit at k -> 0, with the reason."""
        return self.refused

    def frequency_response(self, k: ArrayLike) -> ComplexArray:
        """``D + C (ik - A)^{-1} B``, shape (n_k, n_outputs, n_inputs)."""
        ks = np.atleast_1d(np.asarray(k, dtype=float))
        shifted = 1j * ks[:, None, None] * np.eye(self.order) - self.a
        states = np.linalg.solve(shifted, self.b.astype(complex))
        return np.asarray(self.d + self.c @ states, dtype=np.complex128)

    def respond(self, inputs: MotionInputs) -> Array:
        """Loads less `baseline` under `inputs`, exact for inputs linear between samples, shape (n, n_outputs).

        In modal form, or by matrix exponentials where there is none.
        """
        if self._modes is not None:
            return self._modes.respond(inputs.s, inputs.values, inputs.before)[:: inputs.stride]
        start = np.asarray(-np.linalg.solve(self.a, self.b @ inputs.before), dtype=float)
        states = simulate(self.a, self.b, inputs.s, inputs.values, start)[:: inputs.stride]
        loads: Array = states @ self.c.T + inputs.values[:: inputs.stride] @ self.d.T
        return loads

    def step(self, s: ArrayLike) -> StepResponses:
        """Responses to unit steps of each input at reduced times `s`, from 0 (0+)."""
        grid = np.asarray(s, dtype=float)
        responses = []
        for j, name in enumerate(self.inputs):
            unit = np.zeros((grid.size, len(self.inputs)))
            unit[:, j] = 1.0
            load = self.respond(MotionInputs(grid, unit, np.zeros(len(self.inputs))))
            responses.append(StepResponse(name, grid, load, final=self.static_gain[:, j]))
        return StepResponses(
            tuple(responses), self.outputs, self.baseline, self.condition, self.reference, self.describe()
        )

    def describe(self) -> dict[str, Any]:
        """Kind and parameters as plain values."""
        return {**super().describe(), "method": self.method, "order": self.order}

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for files."""
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            **{name: getattr(self, name).tolist() for name in ("a", "b", "c", "d", "baseline")},
            **self._described(),
        }

    def _described(self) -> dict[str, Any]:
        return {
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "condition": asdict(self.condition),
            "reference": self.reference.to_dict(),
            "method": self.method,
            "errors": [asdict(error) for error in self.errors],
            "candidates": [asdict(candidate) for candidate in self.candidates],
            "refused": dict(self.refused),
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """Inverse of `to_dict`."""
        n, m, p = len(values["a"]), len(values["inputs"]), len(values["outputs"])
        shapes = {"a": (n, n), "b": (n, m), "c": (p, n), "d": (p, m), "baseline": (6,)}
        return cls(
            **{name: np.asarray(values[name], dtype=float).reshape(shape) for name, shape in shapes.items()},
            inputs=tuple(values["inputs"]),
            outputs=tuple(values["outputs"]),
            condition=FlightCondition(**values["condition"]),
            reference=ReferenceQuantities.from_dict(values["reference"]),
            method=values["method"],
            errors=tuple(ChannelError(**error) for error in values["errors"]),
            candidates=tuple(Candidate(**candidate) for candidate in values["candidates"]),
            refused=dict(values["refused"]),
        )

    def to_json(self, path: str | Path) -> None:
        """Write a JSON file; numbers are exact."""
        write_text(path, json.dumps(self.to_dict(), indent=1))

    @classmethod
    def from_json(cls, path: str | Path) -> Self:
        """Read a file of `to_json`.

        Raises
        ------
        InputError
            If the file is missing, damaged or holds something else.
        """
        values = read_json(path, FORMAT, SCHEMA_VERSION)
        with parts_of(path):
            return cls.from_dict(values)

    def to_dataset(self) -> xarray.Dataset:
        """The model as an `xarray.Dataset` with matrices A, B, C, D."""
        import xarray as xr

        data = {
            "A": (("state", "state_from"), self.a, {"units": "per reduced time 2Vt/c"}),
            "B": (("state", "input"), self.b),
            "C": (("output", "state"), self.c),
            "D": (("output", "input"), self.d, {"long_name": "value at 0+ of the step responses"}),
            "baseline": ("coefficient", self.baseline),
        }
        coords = {"input": list(self.inputs), "output": list(self.outputs), "coefficient": list(COEFFICIENTS)}
        attrs = {"format": FORMAT, "schema_version": SCHEMA_VERSION, "description": json.dumps(self._described())}
        return xr.Dataset(data, coords, attrs)

    def to_netcdf(self, path: str | Path) -> None:
        """Write a netCDF-4 file in one step."""
        write_netcdf(path, self.to_dataset())

    @classmethod
    def from_netcdf(cls, path: str | Path) -> Self:
        """Read a file of `to_netcdf`.

        Raises
        ------
        InputError
            If the file is missing, damaged or holds something else.
        """
        data = read_netcdf(path, FORMAT, SCHEMA_VERSION)
        with parts_of(path):
            matrices = {name.lower(): data[name].values for name in ("A", "B", "C", "D", "baseline")}
            return cls.from_dict({**matrices, **json.loads(data.attrs["description"])})

    def summary(self) -> str:
        """Order, poles, fit of each channel, and the realisations that were compared."""
        lines = [
            f"state-space model ({self.method}) at M {self.condition.mach:g}: {self.order} states, "
            f"{', '.join(self.inputs)} to {', '.join(self.outputs)}",
            "  poles in reduced time: " + ", ".join(_pole_text(pole) for pole in self.poles if pole.imag >= 0.0),
        ]
        lines += [
            f"  {e.output} to {e.input}: error {e.rms:.2%} of the unsteady part, {e.peak:.2%} of the peak at most"
            for e in self.errors
        ]
        for candidate in self.candidates:
            mark = " <- chosen" if candidate.chosen else ""
            lines.append(
                f"  tried for {candidate.input}: {candidate.method}, {candidate.order} states: "
                f"held-out error {candidate.held_out:.2%}{mark}"
            )
        lines += [f"  refused: {reason}" for reason in self.refused.values()]
        return "\n".join(lines)

    def plot(self, responses: StepResponses | None = None) -> Figure:
        """Step responses of the model, over those it was made from if given."""
        import matplotlib.pyplot as plt

        slowest = 1.0 / np.min(np.abs(self.poles.real)) if self.order else 1.0
        shape = (len(self.outputs), len(self.inputs))
        figure, axes = plt.subplots(*shape, squeeze=False, sharex="col", figsize=(4.5 * shape[1], 2.8 * shape[0]))
        for j, name in enumerate(self.inputs):
            end = 6.0 * slowest if responses is None else responses[name].s[-1]
            model = self.step(np.linspace(0.0, end, 400))[name]
            for i, output in enumerate(self.outputs):
                if responses is not None:
                    axes[i, j].plot(*responses.channel(output, name), ".", ms=3, color="0.5", label="step response")
                axes[i, j].plot(model.s, model.values[:, i], label=f"model, {self.order} states")
                axes[i, j].set_ylabel(f"{output} per unit {name}")
            axes[-1, j].set_xlabel("reduced time s = 2Vt/c")
        axes[0, 0].legend()
        figure.tight_layout()
        return figure


def _pole_text(pole: complex) -> str:
    return f"{pole.real:.4g}" if pole.imag == 0.0 else f"{pole.real:.4g} +- {pole.imag:.4g}i"
