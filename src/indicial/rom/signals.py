r"""The inputs of reduced-order models, read from a motion or a history.

Inputs are deviations from the model's condition: angles alpha, beta [rad], and rates p, q, r made dimensionless
as ``q c/2V`` whatever the reference quantities prefer, so that with ``s = 2Vt/c`` a pitching motion at constant
flight path has ``q = d(alpha)/ds``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import Akima1DInterpolator

from indicial.conventions import Array, ReferenceQuantities, flow_angles, reduced_time
from indicial.errors import InputError
from indicial.history import History
from indicial.motion import FlightCondition, Motion

INPUTS = ("alpha", "beta", "p", "q", "r")
"""What a model can answer to: alpha, beta [rad]; p b/2V, q c/2V, r b/2V."""

ANGLES = ("alpha", "beta")

STEP_KINDS = {"alpha_step": ("alpha", "amplitude"), "pitch_rate_step": ("q", "rate_amplitude")}
"""Kinds of step motion: which input jumps, and the name of its amplitude in ``history.motion``."""

_NEGLIGIBLE = 1e-9  # rad, or dimensionless rate: round-off of a prescribed motion


def rate_factor(name: str, speed: float, reference: ReferenceQuantities) -> float:
    """Seconds that turn the rate `name` (p, q or r) [rad/s] into ``p b/2V``, ``q c/2V`` or ``r b/2V``."""
    return float(reference.moment_lengths["pqr".index(name)]) / (2.0 * speed)


def step_of(history: History) -> tuple[str, float]:
    """Input that a step history jumps and its amplitude (rad, or ``q c/2V``).

    Raises
    ------
    InputError
        If the history's motion is not a step of known kind and amplitude.
    """
    kind = history.motion.get("kind")
    if kind not in STEP_KINDS:
        raise InputError(f"history of motion {kind!r} is no step response; step kinds are {', '.join(STEP_KINDS)}")
    name, key = STEP_KINDS[kind]
    amplitude = float(history.motion.get(key, 0.0))
    if not (np.isfinite(amplitude) and amplitude != 0.0):
        raise InputError(f"{kind} history gives {key} {history.motion.get(key)!r}, must be finite and not zero")
    return name, amplitude if name in ANGLES else amplitude * rate_factor(
        name, history.condition.speed, history.reference
    )


@dataclass(frozen=True)
class MotionInputs:
    """Sampled inputs of a model, linear between samples, at rest at `before` until the first sample.

    Parameters
    ----------
    s : ndarray
        Increasing reduced time ``2Vt/c``, shape (n,).
    values : ndarray
        Inputs as deviations from the condition, shape (n, n_inputs).
    before : ndarray
        Inputs before the first sample, shape (n_inputs,); a difference from ``values[0]`` is a jump at ``s[0]``.
    stride : int
        Loads are wanted at every `stride`-th sample, from the first.

    Raises
    ------
    InputError
        If times do not increase, shapes do not fit, or a value is not finite.
    """

    s: Array
    values: Array
    before: Array
    stride: int = 1

    def __post_init__(self) -> None:
        s, values, before = (np.asarray(part, dtype=float) for part in (self.s, self.values, self.before))
        if s.ndim != 1 or s.size < 1 or not np.all(np.diff(s) > 0.0) or not np.all(np.isfinite(s)):
            raise InputError("reduced times of inputs must be one-dimensional, finite and strictly increasing")
        if values.ndim != 2 or len(values) != s.size or before.shape != values.shape[1:]:
            raise InputError(
                f"inputs of shape {values.shape}, before the first sample {before.shape}, do not fit {s.size} samples"
            )
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(before))):
            raise InputError("inputs hold values that are not finite")
        for name, array in (("s", s), ("values", values), ("before", before)):
            object.__setattr__(self, name, array)

    @classmethod
    def from_history(
        cls,
        history: History,
        names: tuple[str, ...],
        condition: FlightCondition,
        *,
        neglect: tuple[str, ...] = (),
        substeps: int = 8,
    ) -> Self:
        """The inputs that made `history`.

        Parameters
        ----------
        history : History
            Its motion says whether it starts with a jump; if not, its first sample is the steady state before.
        names : tuple of str
            Inputs wanted, of `INPUTS`.
        condition : FlightCondition
            The state from which inputs are counted.
        neglect : tuple of str
            Inputs that may vary without being among `names`.
        substeps : int
            Into how many linear pieces each interval is cut, along Akima's local cubics through the samples
            (J. ACM 17, 1970); with 1 the motion is linear between samples.

        Raises
        ------
        InputError
            If an input varies that is neither wanted nor to be neglected.
        """
        inputs = _inputs(history.velocity, history.rate, history.condition.speed, condition, history.reference)
        before = inputs[0].copy()
        if history.motion.get("kind") in STEP_KINDS:
            name, amplitude = step_of(history)
            before[INPUTS.index(name)] -= amplitude
        values, start = _chosen(inputs, before, names, neglect)
        if substeps == 1 or history.s.size < 3:
            return cls(history.s, values, start)
        fine = _refined(history.s, substeps)
        return cls(fine, Akima1DInterpolator(history.s, values)(fine), start, stride=substeps)

    @classmethod
    def from_motion(
        cls,
        motion: Motion,
        times: ArrayLike,
        speed: float,
        names: tuple[str, ...],
        condition: FlightCondition,
        reference: ReferenceQuantities,
        *,
        neglect: tuple[str, ...] = (),
        substeps: int = 8,
    ) -> Self:
        """The inputs of `motion` at `times` [s], each interval sampled at `substeps` instants more closely."""
        t = np.asarray(times, dtype=float)
        if t.ndim != 1 or t.size < 1 or t[0] != 0.0 or not np.all(np.diff(t) > 0.0):
            raise InputError("times must be one-dimensional, start at 0 (that is 0+) and strictly increase")
        fine = _refined(t, substeps)
        inputs = _inputs(motion.velocity(fine), motion.rate(fine), speed, condition, reference)
        before = _inputs(motion.velocity_before[None], motion.rate_before[None], speed, condition, reference)[0]
        s = reduced_time(fine, speed, reference.length)
        return cls(s, *_chosen(inputs, before, names, neglect), stride=substeps)


def _refined(samples: Array, substeps: int) -> Array:
    if substeps < 1:
        raise InputError(f"substeps is {substeps}, must be at least 1")
    fine: Array = np.interp(np.arange(substeps * (samples.size - 1) + 1), substeps * np.arange(samples.size), samples)
    return fine


def _inputs(
    velocity: Array, rate: Array, speed: float, condition: FlightCondition, reference: ReferenceQuantities
) -> Array:
    """All of `INPUTS`, shape (n, 5)."""
    _, alpha, beta = flow_angles(velocity)
    rates = [rate[:, j] * rate_factor(name, speed, reference) for j, name in enumerate("pqr")]
    return np.stack([alpha - condition.alpha, beta - condition.beta, *rates], axis=1)


def _chosen(inputs: Array, before: Array, names: tuple[str, ...], neglect: tuple[str, ...]) -> tuple[Array, Array]:
    moving = np.max(np.abs(np.vstack([before, inputs])), axis=0) > _NEGLIGIBLE
    left = [n for n, moves in zip(INPUTS, moving, strict=True) if moves and n not in (*names, *neglect)]
    if left:
        raise InputError(f"the motion varies {', '.join(left)}, but the model's inputs are {', '.join(names)}")
    columns = [INPUTS.index(name) for name in names]
    return inputs[:, columns], before[columns]


def check_names(names: tuple[str, ...], allowed: tuple[str, ...], what: str) -> None:
    """Refuse names that are unknown, repeated or missing."""
    unknown: list[Any] = [name for name in names if name not in allowed]
    if unknown or not names or len(set(names)) != len(names):
        raise InputError(f"{what} are {names}, must be distinct ones of {', '.join(allowed)}")


def quadrature_weights(s: Array) -> Array:
    """Trapezoidal quadrature weights of samples at s, shape (n,), n >= 2."""
    half = 0.5 * np.diff(s)
    weights: Array = np.append(half, 0.0) + np.append(0.0, half)
    return weights
