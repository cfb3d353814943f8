r"""Range reduction by linear theory: drag, epicyclic motion, swerve and roll, each fitted in turn.

With s the distance flown [m], ``eta = -psi + i theta`` the attitude and ``sigma = y + i z`` the swerve of axes that
do not roll (y right, z down), ``L = rho S CL_alpha/2m`` and V = V0 exp(-b s):

    t      = t0 + (exp(b s) - 1)/(b V0),                        b = rho S CD/2m
    eta    = sum over arms of A exp(lambda s) + A_T - i g (exp(2 b s) - 1)/(2 b V0^2)
    sigma  = c0 + c1 s - L sum of K/lambda^2 exp(lambda s) + i g (exp(2 b s) - 1 - 2 b s)/(4 b^2 V0^2)
    phi    = r0 + r1 (1 - exp(-k s))/k,                         k = -rho S c^2 Cl_p/(2 f Ix) - b  (no fin cant)

with ``K = A/(1 + L/lambda)`` the arms of the incidence, f = 2 for rates per c/2V and 1 for c/V. The fast and slow arm
share what the theory of a missile without Magnus moment has them share, so that an arm which hardly moves does no harm:

    lambda = (-(H - iP) +- sqrt((H - iP)^2 + 4 M))/2,           P = (Ix/Iy) p/V
    H = (rho S/2m)(CL_alpha - CD - (m c^2/f Iy)(Cm_q + Cm_alphadot)),  M = rho S c Cm_alpha/2 Iy

Murphy, "Free Flight Motion of Symmetric Missiles", BRL R-1216 (1963); McCoy, "Modern Exterior Ballistics" (1999),
ch. 10 and 14. It needs no start values, and gives them to the output error method.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array, ReferenceQuantities
from indicial.derivatives import DerivativeTable
from indicial.errors import InputError
from indicial.flightsim import Arm, EpicyclicFit, Vehicle
from indicial.flightsim.epicycle import order_arms
from indicial.identification.estimate import Estimate, identified_table
from indicial.identification.measurement import RangeRecord
from indicial.motion import FlightCondition

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Complex = NDArray[np.complex128]

_LARGEST = math.radians(45.0)  # angles that are small no more
_EXPLAINED = 0.2  # least part of the angles' variance that the epicycle must account for


@dataclass(frozen=True)
class LinearTheory:
    """What linear theory makes of a record.

    Parameters
    ----------
    derivatives : tuple of Estimate
        CA_0, CN_alpha, Cm_alpha, Cm_q+Cm_alphadot, and Cl_p if roll was measured, about the centre of gravity, with
        the standard errors of white residuals.
    initial : dict
        State at the first station: x, y, z [m], Vx, Vy, Vz [m/s] (earth axes), yaw, pitch, roll [rad], p, q, r [rad/s].
    epicycle : EpicyclicFit
        Of the attitude, gravity's part taken out, over distance from the first station.
    mach : float
        At the middle of the record.
    mean_square_yaw : float
        Mean square of the total incidence, weighted as the drag of the record is [rad^2].
    reference : ReferenceQuantities
    record : RangeRecord
    fitted : ndarray
        eta [rad] at the stations, complex, shape (n,).
    """

    derivatives: tuple[Estimate, ...]
    initial: dict[str, float]
    epicycle: EpicyclicFit
    mach: float
    mean_square_yaw: float
    reference: ReferenceQuantities
    record: RangeRecord
    fitted: Complex

    def value(self, name: str) -> float:
        """Value of one derivative.

        Raises
        ------
        InputError
            If linear theory does not give it.
        """
        for estimate in self.derivatives:
            if estimate.name == name:
                return estimate.value
        raise InputError(f"linear theory gives {', '.join(e.name for e in self.derivatives)}, not {name}")

    def table(self, condition: FlightCondition | None = None, source: str = "linear theory") -> DerivativeTable:
        """The derivatives as records of method ``identified``, at the Mach number of the record unless told."""
        where = FlightCondition(self.mach) if condition is None else condition
        return identified_table(self.derivatives, where, self.reference, source)

    def summary(self) -> str:
        """Derivatives and arms."""
        yaw = math.degrees(math.sqrt(self.mean_square_yaw))
        lines = [f"linear theory at Mach {self.mach:.4g}, root mean square yaw {yaw:.3g} deg"]
        lines += [f"  {estimate.summary()}" for estimate in self.derivatives]
        return "\n".join([*lines, *(f"  {line}" for line in self.epicycle.summary().splitlines())])

    def plot(self) -> Figure:
        """Measured attitude and the fitted epicycle."""
        import matplotlib.pyplot as plt

        figure, ax = plt.subplots(figsize=(9, 4), layout="constrained")
        x, degree = self.record.x, math.degrees(1.0)
        for name, fitted in (("yaw", -self.fitted.real), ("pitch", self.fitted.imag)):
            (line,) = ax.plot(x, degree * fitted, label=f"{name}, epicycle")
            ax.plot(x, degree * getattr(self.record, name), ".", color=line.get_color(), label=f"{name}, measured")
        ax.set(xlabel="x [m]", ylabel="angle [deg]")
        ax.legend()
        return figure


@dataclass(frozen=True)
class _Drag:
    """``t = t0 + (exp(b s) - 1)/(b V0)``: V0 [m/s], b [1/m] and the variance of b."""

    speed: float
    decay: float
    variance: float

    def turned(self, s: Array, g: float) -> Array:
        """Angle by which gravity g turns the path downward, to s [rad]."""
        return g * s * _growth(2.0 * self.decay * s) / self.speed**2

    def dropped(self, s: Array, g: float) -> Array:
        """Drop by gravity g, to s [m]."""
        return g * s**2 * _growth_of_growth(2.0 * self.decay * s) / self.speed**2


def linear_theory(
    record: RangeRecord, vehicle: Vehicle, density: float, speed_of_sound: float, g: float
) -> LinearTheory:
    """Reduce a record by linear theory.

    Parameters
    ----------
    record : RangeRecord
        Near enough to level, straight flight that distance flown is x.
    vehicle : Vehicle
    density : float
        [kg/m^3].
    speed_of_sound : float
        [m/s].
    g : float
        Gravity [m/s^2].

    Raises
    ------
    InputError
        If no oscillation of the angles, of at least one wavelength, can be told from noise.
    """
    if max(np.max(np.abs(record.yaw)), np.max(np.abs(record.pitch))) > _LARGEST:
        raise InputError("the angles of this record exceed 45 deg: the missile tumbles, linear theory cannot reduce it")
    s = record.x - record.x[0]
    drag = _fit_drag(s, record.time)
    attitude = -record.yaw + 1j * (record.pitch + drag.turned(s, g))
    roll, roll_slope, roll_decay, roll_variance = (0.0,) * 4 if record.roll is None else _fit_roll(s, record.roll)
    spin = roll_slope * float(np.mean(np.exp(-roll_decay * s)))
    motion = _fit_epicycle(s, attitude, vehicle.inertia[0, 0] / vehicle.inertia[1, 1] * spin)
    epicycle = motion.fit
    swerve = record.y + 1j * (record.z - drag.dropped(s, g))
    lift, lift_variance, constants = _fit_swerve(epicycle, s, swerve)

    reference = vehicle.reference.about(vehicle.centre_of_gravity)
    factor = 2.0 if reference.rate_normalisation == "c/2V" else 1.0
    transverse = vehicle.inertia[1, 1]
    per_metre = density * reference.area / (2.0 * vehicle.mass)
    radius = vehicle.mass * reference.length**2 / (factor * transverse)

    # the parabola fitted to time weighs the drag at s by s^2 (l - s)^2, that is by the square of the swerve it makes
    weight = s**2 * (s[-1] - s) ** 2
    mean_square = float(np.average(np.abs(_incidence(epicycle, lift, s)) ** 2, weights=weight))
    drag_coefficient = drag.decay / per_metre
    lift_slope = lift / per_metre
    normal_slope = lift_slope + drag_coefficient
    axial = drag_coefficient - normal_slope * mean_square
    total = (lift_slope - drag_coefficient - motion.damping / per_metre) / radius
    pressure = density * reference.area * reference.length / (2.0 * transverse)
    # drag, attitude and swerve are independent fits: their variances add
    drag_variance = drag.variance / per_metre**2
    slope_variance = lift_variance / per_metre**2
    derivatives = [
        Estimate("CA_0", axial, math.sqrt(drag_variance + mean_square**2 * slope_variance)),
        Estimate("CN_alpha", normal_slope, math.sqrt(slope_variance + drag_variance)),
        Estimate("Cm_alpha", motion.stiffness / pressure, math.sqrt(motion.stiffness_variance) / pressure),
        Estimate(
            "Cm_q+Cm_alphadot",
            total,
            math.sqrt(slope_variance + drag_variance + motion.damping_variance / per_metre**2) / radius,
        ),
    ]
    if record.roll is not None:
        scale = density * reference.area * reference.length**2 / (2.0 * factor * vehicle.inertia[0, 0])
        derivatives.append(Estimate("Cl_p", -(roll_decay + drag.decay) / scale, math.sqrt(roll_variance) / scale))
    return LinearTheory(
        derivatives=tuple(derivatives),
        initial=_initial(record, drag, epicycle, constants, (roll, roll_slope), g),
        epicycle=epicycle,
        mach=float(drag.speed * np.exp(-0.5 * drag.decay * s[-1]) / speed_of_sound),
        mean_square_yaw=mean_square,
        reference=reference,
        record=record,
        fitted=epicycle(s) - 1j * drag.turned(s, g),
    )


def _growth(x: Array) -> Array:
    """``(exp(x) - 1)/x``, 1 at 0."""
    return np.divide(np.expm1(x), x, out=np.ones_like(x), where=np.abs(x) > 1e-12)


def _growth_of_growth(x: Array) -> Array:
    """``(exp(x) - 1 - x)/x^2``, 1/2 at 0; by its series where that is exact."""
    small = np.abs(x) < 0.1
    series = sum(x**n / math.factorial(n + 2) for n in range(8))
    closed = np.divide(np.expm1(x) - x, x**2, out=np.zeros_like(x), where=~small)
    return np.where(small, series, closed)


def _variances(jacobian: Array, residual: Array) -> Array:
    """Covariance of a real least-squares fit with white residuals."""
    freedom = residual.size - jacobian.shape[1]
    covariance: Array = np.linalg.pinv(jacobian.T @ jacobian) * float(residual @ residual) / freedom
    return covariance


def _fit_drag(s: Array, time: Array) -> _Drag:
    """Start time, speed and decay by Gauss-Newton; the error of x counts as one of time."""
    slowness, half = np.polynomial.polynomial.polyfit(s, time, 2)[1:]
    values = np.array([time[0], slowness, 2.0 * half / slowness])
    for _ in range(6):
        t0, slowness, b = values
        model = t0 + slowness * s * _growth(b * s)
        by_decay = slowness * s**2 * (_growth(b * s) - _growth_of_growth(b * s))
        jacobian = np.stack([np.ones_like(s), s * _growth(b * s), by_decay], axis=1)
        # columns of very different size: scaled to be solved well
        size = np.linalg.norm(jacobian, axis=0)
        values = values + np.linalg.lstsq(jacobian / size, time - model, rcond=None)[0] / size
    covariance = _variances(jacobian / size, time - model) / np.outer(size, size)
    return _Drag(1.0 / float(values[1]), float(values[2]), float(covariance[2, 2]))


@dataclass(frozen=True)
class _Motion:
    """Epicycle, H [1/m] and M [1/m^2] with their variances."""

    fit: EpicyclicFit
    damping: float
    stiffness: float
    damping_variance: float
    stiffness_variance: float


def _fit_epicycle(s: Array, attitude: Complex, gyration: float) -> _Motion:
    """Fit H and M at given P = `gyration` [1/m], amplitudes and trim eliminated (variable projection).

    It starts from the best of a scan of undamped motions, up to two stations a wavelength.
    """
    from scipy.optimize import least_squares

    length = s[-1]

    def waves(damping: float, stiffness: float) -> Complex:
        exponents = np.outer(s, _roots(damping, stiffness, gyration))
        # trial roots far off may grow beyond any float
        return np.column_stack([np.exp(np.minimum(exponents.real, 50.0) + 1j * exponents.imag), np.ones_like(s)])

    def misfit(scaled: Array) -> Array:
        basis = waves(scaled[0] / length, scaled[1] / length**2)
        error = basis @ np.linalg.lstsq(basis, attitude, rcond=None)[0] - attitude
        return np.concatenate([error.real, error.imag])

    highest = math.pi * (s.size - 1)
    start = np.array([1.0, -(_best_turning(s / length, attitude, highest) ** 2)])
    found = least_squares(misfit, start, x_scale="jac").x
    damping, stiffness = float(found[0] / length), float(found[1] / length**2)
    basis = waves(damping, stiffness)
    first, second, trim = np.linalg.lstsq(basis, attitude, rcond=None)[0]
    explained = 1.0 - np.sum(misfit(found) ** 2) / np.sum(np.abs(attitude - attitude.mean()) ** 2)
    if not (-(highest**2) < found[1] < -((2.0 * math.pi) ** 2) and explained > _EXPLAINED):
        raise InputError(
            "the angles of this record do not oscillate above their noise: give a larger yaw, or more stations"
        )
    roots = _roots(damping, stiffness, gyration)
    arms = {complex(r): Arm(complex(a), complex(r)) for r, a in zip(roots, (first, second), strict=True)}
    fast, slow = order_arms(complex(roots[0]), complex(roots[1]))
    residual = basis @ np.array([first, second, trim]) - attitude
    half = np.array([1.0, -1.0]) * (roots[0] - roots[1]) / 2.0
    by_damping = -0.5 + (damping - 1j * gyration) / (4.0 * half)
    by_stiffness = 1.0 / (2.0 * half)
    moving = s[:, None] * basis[:, :2] * np.array([first, second])
    # every complex amplitude is two real ones, whose columns are g and i g
    columns = np.column_stack([moving @ by_damping, moving @ by_stiffness, basis, 1j * basis])
    jacobian = np.vstack([columns.real, columns.imag])
    size = np.linalg.norm(jacobian, axis=0)
    variances = np.diag(_variances(jacobian / size, np.concatenate([residual.real, residual.imag]))) / size**2
    return _Motion(
        EpicyclicFit(arms[fast], arms[slow], complex(trim), float(np.sqrt(np.mean(np.abs(residual) ** 2)))),
        damping,
        stiffness,
        float(variances[0]),
        float(variances[1]),
    )


def _best_turning(s: Array, attitude: Complex, highest: float) -> float:
    """Turning rate [rad] per unit of s, of those up to `highest`, of the undamped arms that fit best."""
    turning = np.arange(math.pi, highest, 0.5)
    wave = np.exp(1j * turning[:, None] * s)
    basis, _ = np.linalg.qr(np.stack([wave, wave.conj(), np.ones_like(wave)], axis=-1))
    power = np.sum(np.abs(np.einsum("wsi,s->wi", basis.conj(), attitude)) ** 2, axis=1)
    return float(turning[np.argmax(power)])


def _roots(damping: float, stiffness: float, gyration: float) -> Complex:
    """Both lambda [1/m] of H, M and P."""
    middle = -0.5 * (damping - 1j * gyration)
    half = np.sqrt(middle**2 + stiffness)
    return np.array([middle + half, middle - half])


def _incidence(epicycle: EpicyclicFit, lift: float, s: Array) -> Complex:
    """xi at s: the arms of the attitude less the turning of the path they cause."""
    arms = (epicycle.fast, epicycle.slow)
    waves = (a.amplitude / (1.0 + lift / a.eigenvalue) * np.exp(a.eigenvalue * s) for a in arms)
    total: Complex = sum(waves, start=np.zeros(s.shape, dtype=complex))
    return total


def _fit_swerve(epicycle: EpicyclicFit, s: Array, swerve: Complex) -> tuple[float, float, tuple[complex, complex]]:
    """L [1/m] and its variance, and (position [m], slope) of the path at s = 0, y + i z."""
    arms = (epicycle.fast, epicycle.slow)
    lift = 0.0
    for _ in range(4):  # K depends on L, weakly: each pass gains two digits
        amplitudes = [a.amplitude / (1.0 + lift / a.eigenvalue) for a in arms]
        pulled = -sum(k / a.eigenvalue**2 * np.exp(a.eigenvalue * s) for k, a in zip(amplitudes, arms, strict=True))
        one = np.ones_like(s)
        columns = np.stack([pulled, one, 1j * one, s, 1j * s], axis=1)
        jacobian = np.vstack([columns.real, columns.imag])
        right = np.concatenate([swerve.real, swerve.imag])
        values = np.linalg.lstsq(jacobian, right, rcond=None)[0]
        lift = float(values[0])
    variance = float(_variances(jacobian, right - jacobian @ values)[0, 0])
    slope = complex(values[3], values[4]) - lift * complex(
        sum(k / a.eigenvalue for k, a in zip(amplitudes, arms, strict=True))
    )
    position = complex(values[1], values[2]) + lift * complex(pulled[0])
    return lift, variance, (position, slope)


def _fit_roll(s: Array, roll: Array) -> tuple[float, float, float, float]:
    """Roll [rad] and its slope [rad/m] at s = 0, decay k [1/m] and its variance.

    k by a scan with the linear coefficients eliminated, refined by a bounded search.
    """
    from scipy.optimize import minimize_scalar

    turned = np.unwrap(roll)

    def columns(k: float) -> Array:
        return np.stack([np.ones_like(s), s * _growth(-k * s)], axis=1)

    def misfit(log_k: float) -> float:
        basis = columns(math.exp(log_k))
        error: Array = turned - basis @ np.linalg.lstsq(basis, turned, rcond=None)[0]
        return float(error @ error)

    scan = np.linspace(math.log(1e-2 / s[-1]), math.log(1e2 / s[-1]), 81)
    best = int(np.argmin([misfit(value) for value in scan]))
    bounds = (scan[max(best - 1, 0)], scan[min(best + 1, scan.size - 1)])
    k = math.exp(minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-8}).x)
    basis = columns(k)
    start, slope = np.linalg.lstsq(basis, turned, rcond=None)[0]
    by_decay = -slope * s**2 * (_growth(-k * s) - _growth_of_growth(-k * s))
    jacobian = np.column_stack([basis, by_decay])
    variance = _variances(jacobian, turned - basis @ np.array([start, slope]))[2, 2]
    return float(start), float(slope), k, float(variance)


def _initial(
    record: RangeRecord,
    drag: _Drag,
    epicycle: EpicyclicFit,
    path: tuple[complex, complex],
    roll: tuple[float, float],
    g: float,
) -> dict[str, float]:
    """State at the first station."""
    position, slope = path
    arms = (epicycle.fast, epicycle.slow)
    attitude = complex(epicycle(0.0))
    turning = drag.speed * sum(a.amplitude * a.eigenvalue for a in arms)
    yaw_rate, pitch_rate = -turning.real, turning.imag - g / drag.speed
    phi = roll[0]
    yaw, pitch = -attitude.real, attitude.imag
    values: dict[str, Any] = {
        "x": record.x[0],
        "y": position.real,
        "z": position.imag,
        "Vx": drag.speed,
        "Vy": drag.speed * slope.real,
        "Vz": drag.speed * slope.imag,
        "yaw": yaw,
        "pitch": pitch,
        "roll": phi,
        "p": drag.speed * roll[1] - yaw_rate * math.sin(pitch),
        "q": pitch_rate * math.cos(phi) + yaw_rate * math.cos(pitch) * math.sin(phi),
        "r": -pitch_rate * math.sin(phi) + yaw_rate * math.cos(pitch) * math.cos(phi),
    }
    return {name: float(value) for name, value in values.items()}
