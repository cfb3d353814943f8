r"""What it costs to cut a step response off: the deficiency integral of Eq. (17) from records of growing length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError, NoLimitError
from indicial.rom.deficiency import DeficiencyIntegral, deficiency_integral, running_integral

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FEWEST = 12


@dataclass(frozen=True)
class RecordLength:
    """The deficiency integral that a record would have given if it had ended earlier.

    Parameters
    ----------
    name : str
        Of the derivative, ``-integral``.
    final : float
        C(inf) that was taken for the known one.
    s : ndarray
        Where records end, shape (n,).
    with_final : ndarray
        ``integral_0^s F`` with C(inf) known: what is left out is the tail, shape (n,).
    with_last : ndarray
        The same with the record's last sample for C(inf): every error of it counts s times, shape (n,).
    judged : tuple
        What `deficiency_integral` makes of some of the records without knowing C(inf): ``(s, DeficiencyIntegral)``, or
        ``(s, reason)`` where it refuses.
    """

    name: str
    final: float
    s: Array
    with_final: Array
    with_last: Array
    judged: tuple[tuple[float, DeficiencyIntegral | str], ...]

    @property
    def whole(self) -> DeficiencyIntegral | str:
        """What the whole record gives, or why it gives nothing."""
        return self.judged[-1][1]

    def shortest(self, tolerance: float = 0.01) -> float:
        """Reduced time beyond which the integral with the last sample for C(inf) stays within `tolerance` of the whole.

        Raises
        ------
        InputError
            If the whole record gives no integral.
        """
        if isinstance(self.whole, str):
            raise InputError(self.whole)
        off = np.abs(self.with_last - self.whole.value) > tolerance * abs(self.whole.value)
        return (
            float(self.s[min(int(np.flatnonzero(off)[-1]) + 1, self.s.size - 1)]) if np.any(off) else float(self.s[0])
        )

    def summary(self, tolerance: float = 0.01) -> str:
        """How long a record must be, and what shorter ones would have given."""
        if isinstance(self.whole, str):
            return f"{self.name}: no integral: {self.whole}"
        lines = [
            f"{self.name}: the integral is within {tolerance:.0%} of its value from records of s = "
            f"{self.shortest(tolerance):.4g} on, if their last sample is taken for the final value"
        ]
        for end, one in self.judged:
            said = f"refused, {one}" if isinstance(one, str) else f"{one.value:.6g} +- {one.uncertainty:.2g}"
            lines.append(f"  record to s = {end:.4g}: {said}")
        return "\n".join(lines)

    def plot(self, ax: Axes | None = None) -> Axes:
        """The derivative over the length of the record."""
        import matplotlib.pyplot as plt

        axes: Axes = plt.subplots()[1] if ax is None else ax
        axes.plot(self.s, -self.with_final, label="final value known, tail left out")
        axes.plot(self.s, -self.with_last, "--", label="last sample for the final value")
        good = [(end, one) for end, one in self.judged if not isinstance(one, str)]
        if good:
            values, bars = [-one.value for _, one in good], [one.uncertainty for _, one in good]
            axes.errorbar(
                [end for end, _ in good], values, bars, fmt="k.", capsize=3, label="by the tail, with its bar"
            )
        for end in (end for end, one in self.judged if isinstance(one, str)):
            axes.axvline(end, color="0.8", lw=0.8, zorder=0)
        axes.set_xlabel("end of the record, reduced time s = 2Vt/c (grey: refused)")
        axes.set_ylabel(self.name)
        axes.legend(fontsize="small")
        return axes


def record_length(
    s: ArrayLike, response: ArrayLike, final: float | None = None, *, name: str = "response", cuts: int = 8
) -> RecordLength:
    """The deficiency integral of one step response from records that end earlier and earlier.

    Parameters
    ----------
    s, response : array_like
        As of `deficiency_integral`, shape (n,).
    final : float, optional
        C(inf) where it is known; if not, what the whole record gives for it, or its last sample.
    name : str
        Of the derivative.
    cuts : int
        How many records are judged by their tails.
    """
    at, values = np.asarray(s, dtype=float), np.asarray(response, dtype=float)
    if at.ndim != 1 or at.shape != values.shape or at.size < 2 * _FEWEST:
        raise InputError(f"{name}: {2 * _FEWEST} samples or more are needed to see what a shorter record would give")
    judged: list[tuple[float, DeficiencyIntegral | str]] = []
    for end in np.unique(np.linspace(_FEWEST, at.size, cuts).astype(int)):
        known = final if end == at.size else None
        judged.append((float(at[end - 1]), _judged(at[:end], values[:end], known, name)))
    whole = judged[-1][1]
    limit = final if final is not None else float(values[-1]) if isinstance(whole, str) else whole.final
    area = running_integral(at, values)
    kept = slice(_FEWEST - 1, None)
    return RecordLength(
        name, limit, at[kept], (limit * at - area)[kept], (values * at - area)[kept], tuple(judged)
    )  # fmt: skip


def _judged(s: Array, response: Array, final: float | None, name: str) -> DeficiencyIntegral | str:
    try:
        return deficiency_integral(s, response, final, name=name)
    except (NoLimitError, InputError) as error:
        return str(error)
