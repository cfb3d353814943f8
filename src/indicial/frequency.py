r"""Labelled frequency responses of loads to motion, and their netCDF files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.files import read_netcdf, write_netcdf
from indicial.motion import FlightCondition

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

SCHEMA_VERSION = 1
FORMAT = "indicial frequency response"

INPUTS = ("alpha", "alphadot", "q", "beta", "p", "r")
"""Motions from which loads respond: alpha and beta by translation [rad]; ``alphadot c/2V, q c/2V, p b/2V, r b/2V``."""

LATERAL = ("beta", "p", "r")
"""Those of `INPUTS` that are antisymmetric about the plane y = 0."""

_NO_RESPONSE = 1e-6
"""Largest response, relative to the largest there is, of a load that is shown as one that does not respond."""

_NO_LIFT = 1e-3
"""Largest static derivative, relative to CN_alpha, of a load that is counted as one which the wake does not change."""


def reduced_frequencies(k: ArrayLike) -> Array:
    """`k` as an array of reduced frequencies, shape (n,).

    Raises
    ------
    InputError
        If one is negative, not finite or no number.
    """
    try:
        values = np.atleast_1d(np.asarray(k, dtype=float))
    except (TypeError, ValueError):
        raise InputError(f"reduced frequencies are {k!r}, must be numbers, finite and at least 0") from None
    if values.ndim != 1:
        raise InputError(f"reduced frequencies must be a list, not an array of shape {values.shape}")
    for value in values:
        if not (np.isfinite(value) and value >= 0.0):
            raise InputError(f"reduced frequency is {value}, must be finite and at least 0")
    return values


@dataclass(frozen=True)
class FrequencyResponse:
    r"""``H(ik)`` from motion to loads, ``k = omega c/2V``: what a small oscillation ``exp(iks)`` of an input makes.

    Parameters
    ----------
    k : ndarray
        Reduced frequencies, at least 0, shape (n,).
    inputs : tuple of str
        Of `INPUTS`; rates are per ``c/2V`` (``b/2V`` in roll and yaw) whatever `reference` says.
    values : ndarray
        Complex, of (CA, CY, CN, Cl, Cm, Cn), shape (n, 6, n_inputs).
    static, slope : ndarray
        ``H(0)`` and ``H'(0)``, the derivative with respect to ik, each of shape (6, n_inputs). For alphadot `static`
        is the derivative C_alphadot and `slope` is not known (NaN).
    direct : ndarray
        ``H(i inf)``: the jump at the first instant of a step (piston), shape (6, n_inputs).
    baseline : ndarray
        The six coefficients of the steady state, shape (6,).
    condition : FlightCondition
    reference : ReferenceQuantities
    plane : bool
        Whether the flow is two-dimensional.
    provenance : dict
        How it was made (plain values).
    """

    k: Array
    inputs: tuple[str, ...]
    values: NDArray[np.complex128]
    static: Array
    slope: Array
    direct: Array
    baseline: Array
    condition: FlightCondition
    reference: ReferenceQuantities
    plane: bool = False
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "k", reduced_frequencies(self.k))
        check_inputs(self.inputs)
        n, m = len(self.k), len(self.inputs)
        shapes = {"values": (n, 6, m), "static": (6, m), "slope": (6, m), "direct": (6, m), "baseline": (6,)}
        for name, shape in shapes.items():
            values = np.asarray(getattr(self, name))
            if values.shape != shape:
                raise InputError(f"frequency response {name} has shape {values.shape}, must be {shape}")
            object.__setattr__(self, name, values)

    def channel(self, output: str, input: str) -> NDArray[np.complex128]:
        """H(ik) from one input to one load, shape (n,)."""
        values: NDArray[np.complex128] = self.values[:, *self._place(output, input)]
        return values

    def at_zero(self, output: str, input: str) -> tuple[float, float]:
        """``H(0)`` and ``H'(0)`` of one channel."""
        place = self._place(output, input)
        return float(self.static[place]), float(self.slope[place])

    def _place(self, output: str, input: str) -> tuple[int, int]:
        if output not in COEFFICIENTS:
            raise InputError(f"no coefficient {output!r}; there are {', '.join(COEFFICIENTS)}")
        if input not in self.inputs:
            raise InputError(f"no input {input!r} in the frequency response; it has {', '.join(self.inputs)}")
        return COEFFICIENTS.index(output), self.inputs.index(input)

    def to_dataset(self) -> xarray.Dataset:
        """The response as an `xarray.Dataset`, real and imaginary parts apart."""
        import xarray as xr

        data: dict[str, Any] = {
            "real": (("k", "output", "input"), self.values.real),
            "imag": (("k", "output", "input"), self.values.imag),
            "baseline": ("output", self.baseline),
        }
        data |= {name: (("output", "input"), getattr(self, name)) for name in ("static", "slope", "direct")}
        coords = {"k": ("k", self.k, {"units": "1"}), "output": list(COEFFICIENTS), "input": list(self.inputs)}
        attrs = {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "condition": json.dumps(asdict(self.condition)),
            "reference": json.dumps(self.reference.to_dict()),
            "plane": int(self.plane),
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
        return cls(
            k=data["k"].values,
            inputs=tuple(str(name) for name in data["input"].values),
            values=data["real"].values + 1j * data["imag"].values,
            **{name: data[name].values for name in ("static", "slope", "direct", "baseline")},
            condition=FlightCondition(**json.loads(data.attrs["condition"])),
            reference=ReferenceQuantities.from_dict(json.loads(data.attrs["reference"])),
            plane=bool(data.attrs["plane"]),
            provenance=json.loads(data.attrs["provenance"]),
        )

    def summary(self) -> str:
        """Static values and slopes at k = 0 of the loads that respond; "no limit" in place of a slope that has none."""
        lines = [
            f"frequency response at M {self.condition.mach:g} from {', '.join(self.inputs)}, "
            f"{len(self.k)} reduced frequencies" + (f" {self.k[0]:g} to {self.k[-1]:g}" if len(self.k) else "")
        ]
        floor = _NO_RESPONSE * np.max(np.abs(self.static), initial=1e-300)
        endless = self._without_limit()
        for j, source in enumerate(self.inputs):
            for i, output in enumerate(COEFFICIENTS):
                if abs(self.static[i, j]) > floor:
                    slope = "" if np.isnan(self.slope[i, j]) else f", H'(0) = {self.slope[i, j]:.6g}"
                    if slope and output in endless:
                        slope = ", H'(0) has no limit"
                    lines.append(f"  {output} to {source}: H(0) = {self.static[i, j]:.6g}{slope}")
        return "\n".join(lines)

    def _without_limit(self) -> set[str]:
        """Loads whose lag behind any input keeps the wake's tail: those that alpha changes, if plane and subsonic."""
        if "alpha" not in self.inputs:
            return set()
        slopes = {load: self.at_zero(load, "alpha")[0] for load in ("CA", "CN", "Cm")}
        return {name.partition("_")[0] for name in without_limit(self.condition, self.plane, slopes)}

    def plot(self, outputs: tuple[str, ...] | None = None) -> Figure:
        """Part in phase, and part out of phase over k, of each channel against reduced frequency.

        A column for each input: of `outputs`, or, if not given, of CN and Cm (alpha, q), of Cl and Cn (beta, p, r).
        """
        import matplotlib.pyplot as plt

        columns = [outputs or (("Cl", "Cn") if source in LATERAL else ("CN", "Cm")) for source in self.inputs]
        rows = len(columns[0])
        figure, axes = plt.subplots(
            rows, len(columns), squeeze=False, figsize=(4.2 * len(columns), 2.8 * rows), layout="constrained"
        )
        order = np.argsort(self.k)
        moving = order[self.k[order] > 0.0]
        k = self.k[moving]
        for j, (source, column) in enumerate(zip(self.inputs, columns, strict=True)):
            largest = float(np.max(np.abs(self.values[:, :, j]), initial=0.0))
            for panel, output in zip(axes[:, j], column, strict=True):
                values = self.channel(output, source)[moving]
                panel.set_title(f"{output} to {source}", fontsize="medium")
                panel.set_ylabel("per rad")
                if not np.max(np.abs(values), initial=0.0) > _NO_RESPONSE * largest:
                    panel.text(0.5, 0.5, "does not respond", transform=panel.transAxes, ha="center", va="center")
                    panel.set(xticks=(), yticks=())
                    continue
                panel.semilogx(k, values.real, ".-", label="in phase")
                panel.semilogx(k, values.imag / k, ".--", label="out of phase / k")
                panel.set_xlabel("reduced frequency k = ωc/2V")
        axes[0, 0].legend()
        return figure


def check_inputs(inputs: Sequence[str]) -> None:
    """Raise InputError unless all are of `INPUTS` and none comes twice."""
    if isinstance(inputs, str) or not inputs:
        raise InputError(f"inputs is {inputs!r}, must hold one or more of {', '.join(INPUTS)}, such as ('alpha', 'q')")
    for name in inputs:
        if name not in INPUTS:
            raise InputError(f"no input {name!r}; there are {', '.join(INPUTS)}")
    if len(set(inputs)) != len(inputs):
        raise InputError(f"an input comes twice: {', '.join(inputs)}")


def without_limit(condition: FlightCondition, plane: bool, slopes: Mapping[str, float]) -> dict[str, str]:
    """Derivatives with respect to alphadot that have no limit as k goes to 0, with the reason.

    In two-dimensional subsonic flow the vortices shed into the wake induce a downwash that dies out as 1/s. When it
    has become even over the section it acts as a change of alpha, so each load lags in proportion to its own static
    derivative, the integral (17) of the lag grows like log s and ``Im H(ik)/k`` like log k. Only a load that alpha does
    not change, such as the moment about the aerodynamic centre, has a limit; what a mesh gives for the others at
    k = 0 shows how far the mesh reaches.

    Parameters
    ----------
    condition : FlightCondition
    plane : bool
        Whether the flow is two-dimensional.
    slopes : mapping
        Static derivatives with respect to alpha by load, CN among them.
    """
    if condition.mach >= 1.0 or not plane:
        return {}
    return {
        f"{load}_alphadot": (
            f"{load}_alphadot has no limit as k goes to 0: the wake of a two-dimensional subsonic flow makes it grow "
            f"like log k, as {load}_alpha = {slope:.3g} is not zero; ask for values at reduced frequencies above 0"
        )
        for load, slope in slopes.items()
        if abs(slope) > _NO_LIFT * abs(slopes["CN"])
    }
