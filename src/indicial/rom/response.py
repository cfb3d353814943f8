r"""Step responses: what convolution, deficiency functions and realisations are made of."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from scipy.interpolate import PchipInterpolator, PPoly

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.errors import InputError, NoLimitError
from indicial.files import read_netcdf, write_netcdf
from indicial.history import History
from indicial.motion import FlightCondition
from indicial.rom.deficiency import deficiency_integral
from indicial.rom.signals import ANGLES, INPUTS, check_names, step_of

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

SCHEMA_VERSION = 1
FORMAT = "indicial step responses"

Interpolation = Literal["linear", "cubic"]


@dataclass(frozen=True)
class StepResponse:
    """Loads after a unit step of one input.

    Parameters
    ----------
    input : str
        Of `signals.INPUTS`: alpha [rad], q c/2V, ...
    s : ndarray
        Increasing reduced time ``2Vt/c`` from 0 (that is 0+), shape (n,), n >= 2.
    values : ndarray
        Loads per unit input less those before the step, shape (n, n_outputs). ``values[0]`` is the value at 0+
        (the piston jump), which models keep as direct feedthrough.
    final : ndarray, optional
        Settled values, shape (n_outputs,), where known better than by the last sample (the default).
    spread : ndarray, optional
        Half the range between the histories that were averaged, shape (n, n_outputs).
    """

    input: str
    s: Array
    values: Array
    final: Array | None = None
    spread: Array | None = None

    def __post_init__(self) -> None:
        s, values = np.asarray(self.s, dtype=float), np.asarray(self.values, dtype=float)
        if self.input not in INPUTS:
            raise InputError(f"step response to {self.input!r}: inputs are {', '.join(INPUTS)}")
        if s.ndim != 1 or s.size < 2 or not np.all(np.diff(s) > 0.0) or not np.isfinite(s[-1]):
            raise InputError(f"step response to {self.input}: reduced time must increase strictly, two samples or more")
        if values.ndim != 2:
            raise InputError(f"step response to {self.input}: values must be of shape ({s.size}, n_outputs)")
        if s[0] != 0.0:
            raise InputError(
                f"step response to {self.input} starts at s = {s[0]:g}: it must start at 0, "
                "the value at 0+ is the direct feedthrough of every model made from it"
            )
        object.__setattr__(self, "s", s)
        object.__setattr__(self, "values", values)
        shapes = {"values": (s.size, values.shape[-1]), "final": (values.shape[-1],), "spread": values.shape}
        for name, shape in shapes.items():
            given = getattr(self, name)
            if given is None:
                continue
            array = np.asarray(given, dtype=float)
            if array.shape != shape or not np.all(np.isfinite(array)):
                raise InputError(f"step response to {self.input}: {name} must be finite and of shape {shape}")
            object.__setattr__(self, name, array)

    @property
    def initial(self) -> Array:
        """Values at 0+, shape (n_outputs,)."""
        first: Array = self.values[0]
        return first

    @property
    def settled(self) -> Array:
        """Final values, shape (n_outputs,): those given, or the last sample."""
        last: Array = self.values[-1] if self.final is None else self.final
        return last

    @property
    def deficiency(self) -> Array:
        """``F(s) = C(inf) - C(s)`` (Eqs. 14, 15), shape (n, n_outputs)."""
        return self.settled - self.values

    def curve(self, interpolation: Interpolation = "cubic") -> PPoly:
        """The deficiency function as a piecewise polynomial on ``[0, s[-1]]``, values of shape (n_outputs,).

        ``linear``, or ``cubic``: monotone between samples (Fritsch and Carlson, SIAM J. Numer. Anal. 17, 1980).
        """
        if interpolation == "linear" or self.s.size == 2:
            f = self.deficiency
            return PPoly(np.stack([np.diff(f, axis=0) / np.diff(self.s)[:, None], f[:-1]]), self.s)
        if interpolation != "cubic":
            raise InputError(f"interpolation is {interpolation!r}, must be 'linear' or 'cubic'")
        cubic = PchipInterpolator(self.s, self.deficiency, axis=0)
        return PPoly(cubic.c, cubic.x)


@dataclass(frozen=True)
class StepResponses:
    """Step responses of several inputs at one flight condition, each on its own time grid.

    Parameters
    ----------
    responses : tuple of StepResponse
        One for each input.
    outputs : tuple of str
        Names of the columns, of the six coefficients.
    baseline : ndarray
        (CA, CY, CN, Cl, Cm, Cn) of the steady state before the steps, shape (6,).
    condition : FlightCondition
    reference : ReferenceQuantities
    provenance : dict
        How they were made (plain values).
    """

    responses: tuple[StepResponse, ...]
    outputs: tuple[str, ...]
    baseline: Array
    condition: FlightCondition
    reference: ReferenceQuantities
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_names(self.inputs, INPUTS, "inputs of step responses")
        check_names(self.outputs, COEFFICIENTS, "outputs of step responses")
        for response in self.responses:
            if response.values.shape[1] != len(self.outputs):
                raise InputError(f"step response to {response.input} has not {len(self.outputs)} outputs")
        baseline = np.asarray(self.baseline, dtype=float)
        if baseline.shape != (6,) or not np.all(np.isfinite(baseline)):
            raise InputError("baseline must be six finite coefficients")
        object.__setattr__(self, "baseline", baseline)

    @classmethod
    def from_histories(cls, histories: Sequence[History], outputs: tuple[str, ...] = ("CN", "Cm")) -> Self:
        """Responses per unit input, ``(C - C before)/amplitude``.

        Parameters
        ----------
        histories : sequence of History
            Steps in alpha or in pitch rate, all at one condition. Several steps of one input (two signs, two
            amplitudes) on the same instants are averaged; the equal weights of a +- pair cancel what is quadratic.
        outputs : tuple of str

        Raises
        ------
        InputError
            If a history is no step, conditions differ, or steps of one input have different instants.
        """
        if not histories:
            raise InputError("no histories given, at least one step is needed")
        check_names(outputs, COEFFICIENTS, "outputs of step responses")
        first = histories[0]
        columns = [COEFFICIENTS.index(name) for name in outputs]
        found: dict[str, list[tuple[Array, Array]]] = {}
        for history in histories:
            if history.condition != first.condition or history.reference != first.reference:
                raise InputError("step histories differ in flight condition or reference quantities")
            name, amplitude = step_of(history)
            unit = (history.coefficients - history.before)[:, columns] / amplitude
            found.setdefault(name, []).append((history.s, unit))
        return cls(
            responses=tuple(_averaged(name, found[name]) for name in INPUTS if name in found),
            outputs=outputs,
            baseline=np.mean([history.before for history in histories], axis=0),
            condition=first.condition,
            reference=first.reference,
            provenance={"histories": len(histories), "source": first.provenance},
        )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, in the order of `responses`."""
        return tuple(response.input for response in self.responses)

    def __getitem__(self, name: str) -> StepResponse:
        """The response to one input."""
        if name not in self.inputs:
            raise InputError(f"no response to {name!r}; there are {', '.join(self.inputs)}")
        return self.responses[self.inputs.index(name)]

    def channel(self, output: str, input_: str) -> tuple[Array, Array]:
        """Reduced time (n,) and response per unit input (n,) of one coefficient to one input."""
        response = self[input_]
        if output not in self.outputs:
            raise InputError(f"no output {output!r}; there are {', '.join(self.outputs)}")
        return response.s, response.values[:, self.outputs.index(output)]

    @property
    def initial(self) -> Array:
        """Values at 0+, shape (n_outputs, n_inputs)."""
        return np.stack([response.initial for response in self.responses], axis=1)

    @property
    def final(self) -> Array:
        """Settled values, shape (n_outputs, n_inputs)."""
        return np.stack([response.settled for response in self.responses], axis=1)

    def without_limit(self) -> dict[str, str]:
        """Derivatives ``CN_alphadot``, ... whose integral (17) has no limit or cannot be judged, with the reason."""
        reasons = {}
        for response in self.responses:
            if response.input not in ANGLES:
                continue
            for i, output in enumerate(self.outputs):
                name = f"{output}_{response.input}dot"
                final = None if response.final is None else float(response.final[i])
                try:
                    deficiency_integral(response.s, response.values[:, i], final, name=name)
                except (NoLimitError, InputError) as error:
                    reasons[name] = str(error)
        return reasons

    def to_dataset(self) -> xarray.Dataset:
        """The responses as an `xarray.Dataset`: ``s_alpha``, ``response_alpha``, ``final_alpha``, ..."""
        import xarray as xr

        data: dict[str, Any] = {"baseline": ("coefficient", self.baseline, {"units": "1"})}
        coords: dict[str, Any] = {"output": list(self.outputs), "coefficient": list(COEFFICIENTS)}
        for r in self.responses:
            grid = f"s_{r.input}"
            unit = "1/rad" if r.input in ANGLES else "per rate c/2V"
            coords[grid] = (grid, r.s, {"units": "1", "long_name": "reduced time 2Vt/c"})
            data[f"response_{r.input}"] = ((grid, "output"), r.values, {"units": unit})
            if r.final is not None:
                data[f"final_{r.input}"] = ("output", r.final, {"units": unit})
            if r.spread is not None:
                data[f"spread_{r.input}"] = ((grid, "output"), r.spread, {"units": unit})
        attrs = {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "inputs": json.dumps(self.inputs),
            "condition": json.dumps(asdict(self.condition)),
            "reference": json.dumps(self.reference.to_dict()),
            "provenance": json.dumps(self.provenance),
        }
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
            If the file is missing or holds something else.
        """
        data = read_netcdf(path, FORMAT, SCHEMA_VERSION)

        def optional(name: str) -> Array | None:
            return data[name].values if name in data else None

        responses = tuple(
            StepResponse(
                input=name,
                s=data[f"s_{name}"].values,
                values=data[f"response_{name}"].values,
                final=optional(f"final_{name}"),
                spread=optional(f"spread_{name}"),
            )
            for name in json.loads(data.attrs["inputs"])
        )
        return cls(
            responses=responses,
            outputs=tuple(str(name) for name in data["output"].values),
            baseline=data["baseline"].values,
            condition=FlightCondition(**json.loads(data.attrs["condition"])),
            reference=ReferenceQuantities.from_dict(json.loads(data.attrs["reference"])),
            provenance=json.loads(data.attrs["provenance"]),
        )

    def summary(self) -> str:
        """A few lines: per channel the value at 0+, the final value, and how far averaged steps differ."""
        lines = [f"step responses at M {self.condition.mach:g}"]
        for r in self.responses:
            for j, output in enumerate(self.outputs):
                line = (
                    f"  {output} to {r.input}: {r.initial[j]:.5g} at 0+, {r.settled[j]:.5g} settled (s = {r.s[-1]:.4g})"
                )
                if r.spread is not None:
                    peak = np.max(np.abs(r.values[:, j]))
                    line += f", steps averaged differ by +-{np.max(r.spread[:, j]) / max(peak, 1e-300):.2%} of the peak"
                lines.append(line)
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Every channel against reduced time: a row for each output, a column for each input."""
        import matplotlib.pyplot as plt

        shape = (len(self.outputs), len(self.inputs))
        figure, axes = plt.subplots(*shape, squeeze=False, sharex="col", figsize=(4.5 * shape[1], 2.8 * shape[0]))
        for j, r in enumerate(self.responses):
            for i, output in enumerate(self.outputs):
                axes[i, j].plot(r.s, r.values[:, i])
                axes[i, j].axhline(r.settled[i], color="0.6", lw=0.8, ls="--")
                axes[i, j].set_ylabel(f"{output} per unit {r.input}")
            axes[-1, j].set_xlabel("reduced time s = 2Vt/c")
        figure.tight_layout()
        return figure


def _averaged(name: str, runs: list[tuple[Array, Array]]) -> StepResponse:
    s = runs[0][0]
    if any(other.shape != s.shape or not np.allclose(other, s, rtol=1e-9, atol=0.0) for other, _ in runs):
        raise InputError(f"steps in {name} have different instants; sample them alike to average them")
    values = np.stack([unit for _, unit in runs])
    spread = 0.5 * np.ptp(values, axis=0) if len(runs) > 1 else None
    return StepResponse(name, s, values.mean(axis=0), spread=spread)
