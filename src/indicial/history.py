r"""Labelled time histories of loads under a motion, and their netCDF files."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities, flow_angles, reduced_time
from indicial.errors import InputError
from indicial.files import read_netcdf, write_netcdf
from indicial.motion import FlightCondition

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

SCHEMA_VERSION = 1
FORMAT = "indicial history"


@dataclass(frozen=True)
class History:
    """Loads under a motion, sampled in time.

    Parameters
    ----------
    time : ndarray
        Increasing instants [s], shape (n,). ``time[0] = 0`` means 0+, after any jump of the motion.
    coefficients : ndarray
        (CA, CY, CN, Cl, Cm, Cn), body axes, shape (n, 6), made dimensionless with the dynamic pressure and
        speed of `condition` and with `reference`.
    velocity, rate : ndarray
        V_b [m/s] and omega [rad/s] of the motion, body axes, shape (n, 3).
    before : ndarray
        The six coefficients of the steady state from which the motion started (t = 0-), shape (6,).
    condition : FlightCondition
    reference : ReferenceQuantities
    motion : dict
        ``Motion.describe()``: kind and parameters.
    provenance : dict
        How it was made: solver, mesh, convergence, version (plain values).
    """

    time: Array
    coefficients: Array
    velocity: Array
    rate: Array
    before: Array
    condition: FlightCondition
    reference: ReferenceQuantities
    motion: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = np.size(self.time)
        shapes = {"time": (n,), "coefficients": (n, 6), "velocity": (n, 3), "rate": (n, 3), "before": (6,)}
        for name, shape in shapes.items():
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != shape:
                raise InputError(f"history {name} has shape {values.shape}, must be {shape}")
            if not np.all(np.isfinite(values)):
                raise InputError(f"history {name} holds values that are not finite")
            object.__setattr__(self, name, values)
        if n < 1 or np.any(np.diff(self.time) <= 0.0):
            raise InputError("history time must be strictly increasing")

    def __getitem__(self, name: str) -> Array:
        """One coefficient by name, shape (n,)."""
        if name not in COEFFICIENTS:
            raise InputError(f"no coefficient {name!r}; there are {', '.join(COEFFICIENTS)}")
        return self.coefficients[:, COEFFICIENTS.index(name)]

    def initial(self, name: str) -> float:
        """One coefficient of the steady state at t = 0-."""
        return float(self.before[COEFFICIENTS.index(name)])

    @property
    def s(self) -> Array:
        """Reduced time ``2 U t / c``, shape (n,)."""
        return reduced_time(self.time, self.condition.speed, self.reference.length)

    @property
    def alpha(self) -> Array:
        """Angle of attack [rad], shape (n,)."""
        return flow_angles(self.velocity)[1]

    @property
    def reduced_rate(self) -> Array:
        """(p, q, r) made dimensionless as `reference` says (``q c/2V``), shape (n, 3)."""
        return self.rate * self.reference.rate_scale(self.condition.speed)

    def to_dataset(self) -> xarray.Dataset:
        """The history as an `xarray.Dataset` with units."""
        import xarray as xr

        data: dict[str, Any] = {
            name: ("time", self[name], {"units": "1", "before": self.initial(name)}) for name in COEFFICIENTS
        }
        data["velocity"] = (("time", "axis"), self.velocity, {"units": "m/s", "axes": "body"})
        data["rate"] = (("time", "axis"), self.rate, {"units": "rad/s", "axes": "body"})
        coords = {"time": ("time", self.time, {"units": "s"}), "axis": ["x", "y", "z"]}
        attrs = {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "condition": json.dumps(asdict(self.condition)),
            "reference": json.dumps(self.reference.to_dict()),
            "motion": json.dumps(self.motion),
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
            If the file is missing or not an indicial history.
        """
        data = read_netcdf(path, FORMAT, SCHEMA_VERSION)
        return cls(
            time=data["time"].values,
            coefficients=np.stack([data[name].values for name in COEFFICIENTS], axis=1),
            velocity=data["velocity"].values,
            rate=data["rate"].values,
            before=np.array([data[name].attrs["before"] for name in COEFFICIENTS]),
            condition=FlightCondition(**json.loads(data.attrs["condition"])),
            reference=ReferenceQuantities.from_dict(json.loads(data.attrs["reference"])),
            motion=json.loads(data.attrs["motion"]),
            provenance=json.loads(data.attrs["provenance"]),
        )

    def summary(self) -> str:
        """One line: motion, condition, length."""
        kind = self.motion.get("kind", "motion")
        return f"{kind} at M {self.condition.mach:g}: {self.time.size} instants to s = {self.s[-1]:.4g}"

    def plot(self, names: tuple[str, ...] = ("CN", "Cm"), ax: Axes | None = None) -> Axes:
        """Coefficients against reduced time."""
        import matplotlib.pyplot as plt

        axes: Axes = plt.subplots()[1] if ax is None else ax
        for name in names:
            axes.plot(self.s, self[name], label=name)
        axes.set_xlabel("reduced time s = 2Ut/c")
        axes.set_ylabel("coefficient")
        axes.legend()
        return axes
