"""Handling-qualities levels of an aircraft's modes: MIL-F-8785C (1980).

Level 1 is satisfactory, 2 acceptable, 3 controllable; None is worse than level 3. Classes: I light, II medium (II-L
from land, II-C from carriers; plain II is II-L), III large, IV manoeuvrable. Flight phase categories: A rapid
manoeuvring, B gradual manoeuvring, C take-off and landing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from indicial.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from indicial.flightsim.modes import Modes

CLASSES = ("I", "II", "II-L", "II-C", "III", "IV")
CATEGORIES = ("A", "B", "C")
_RATED = ("short period", "phugoid", "Dutch roll", "roll", "spiral")

_ANY = math.inf
# Table IV: least and greatest damping ratio of the short period, levels 1 to 3.
_SHORT_PERIOD = {
    "A": ((0.35, 1.30), (0.25, 2.00), (0.15, _ANY)),
    "B": ((0.30, 2.00), (0.20, 2.00), (0.15, _ANY)),
    "C": ((0.35, 1.30), (0.25, 2.00), (0.15, _ANY)),
}
# Figures 1 to 3: least and greatest omega^2/(n/alpha).
_CAP = {
    "A": ((0.28, 3.6), (0.16, 10.0), (0.16, _ANY)),
    "B": ((0.085, 3.6), (0.038, 10.0), (0.038, _ANY)),
    "C": ((0.16, 3.6), (0.096, 10.0), (0.096, _ANY)),
}
# Table VIII: least time to double, levels 1 to 3.
_SPIRAL = {"A": (12.0, 8.0, 4.0), "B": (20.0, 8.0, 4.0), "C": (12.0, 8.0, 4.0)}


@dataclass(frozen=True)
class Rating:
    """One requirement and the level it gives.

    Parameters
    ----------
    what : str
    paragraph : str
        Of MIL-F-8785C.
    value : str
        What was judged, with units.
    level : int or None
        1, 2, 3, or None: worse than level 3.
    """

    what: str
    paragraph: str
    value: str
    level: int | None


@dataclass(frozen=True)
class HandlingQualities:
    """Ratings of an aircraft in one flight phase.

    Parameters
    ----------
    aircraft_class, category : str
    ratings : tuple of Rating
    unrated : tuple of str
        Modes that no requirement is of: coupled ones, or a pair that does not oscillate.
    """

    aircraft_class: str
    category: str
    ratings: tuple[Rating, ...]
    unrated: tuple[str, ...] = ()

    def __getitem__(self, what: str) -> Rating:
        for rating in self.ratings:
            if rating.what == what:
                return rating
        raise InputError(f"no rating of {what!r}; there are {', '.join(r.what for r in self.ratings)}")

    @property
    def level(self) -> int | None:
        """The worst."""
        levels = [rating.level for rating in self.ratings]
        return None if None in levels else max(level for level in levels if level is not None)

    def summary(self) -> str:
        """A line for each requirement."""
        lines = [f"MIL-F-8785C, class {self.aircraft_class}, category {self.category}: {_say(self.level)}"]
        lines += [f"  {r.what:<24}{_say(r.level):<20}{r.value}  (par. {r.paragraph})" for r in self.ratings]
        lines += [f"  {name:<24}not rated: no requirement is of it" for name in self.unrated]
        return "\n".join(lines)


def rate_modes(
    aircraft_class: str,
    category: str,
    modes: Modes | None = None,
    *,
    short_period: complex | None = None,
    n_alpha: float | None = None,
    phugoid: complex | None = None,
    dutch_roll: complex | None = None,
    roll: float | None = None,
    spiral: float | None = None,
) -> HandlingQualities:
    """Levels of the modes that are given, by their eigenvalues [1/s].

    Parameters
    ----------
    aircraft_class, category : str
        One of `CLASSES`, `CATEGORIES`.
    modes : Modes, optional
        Of `aircraft_modes`: those of their names that are there are rated, but for the ones given below. Coupled modes
        ("roll-spiral") have other names and no requirement here: they are told as not rated.
    short_period, phugoid, dutch_roll : complex, optional
        One of each pair.
    n_alpha : float, optional
        Load factor per angle of attack [g/rad]; with it the short period's frequency is rated.
    roll, spiral : float, optional
        Real eigenvalues.

    Raises
    ------
    InputError
        For another class or category, for nothing to rate, or for values out of bounds.
    """
    if aircraft_class not in CLASSES:
        raise InputError(f"aircraft class {aircraft_class!r} is none of {', '.join(CLASSES)}")
    if category not in CATEGORIES:
        raise InputError(f"flight phase category {category!r} is none of {', '.join(CATEGORIES)}")
    unrated: tuple[str, ...] = ()
    if modes is not None:
        others = (mode.name for mode in modes.modes if mode.name not in _RATED)
        unrated = tuple(name for name in others if not name.startswith(("lag", "altitude")))
        own = {mode.name: mode.eigenvalue for mode in modes.modes}
        short_period = own.get("short period") if short_period is None else short_period
        phugoid = own.get("phugoid") if phugoid is None else phugoid
        dutch_roll = own.get("Dutch roll") if dutch_roll is None else dutch_roll
        roll = own["roll"].real if roll is None and "roll" in own else roll
        spiral = own["spiral"].real if spiral is None and "spiral" in own else spiral
    for name, value in (("short_period", short_period), ("phugoid", phugoid), ("dutch_roll", dutch_roll)):
        if value is not None and not (math.isfinite(abs(value)) and abs(value) > 0.0):
            raise InputError(f"{name} is {value} 1/s, must be finite and not 0")
    nimble = aircraft_class in ("I", "II-C", "IV")
    ratings: list[Rating] = []
    if short_period is not None:
        ratings += _short_period(short_period, n_alpha, category, nimble)
    elif n_alpha is not None:
        raise InputError("n_alpha is of use only with short_period")
    if phugoid is not None:
        ratings.append(_phugoid(phugoid))
    if dutch_roll is not None:
        ratings.append(_dutch_roll(dutch_roll, aircraft_class, category))
    if roll is not None:
        ratings.append(_roll(roll, category, nimble, aircraft_class))
    if spiral is not None:
        least = _SPIRAL[category]
        double = math.log(2.0) / spiral if spiral > 0.0 else math.inf
        said = f"time to double {double:.4g} s" if spiral > 0.0 else "does not grow"
        ratings.append(Rating("spiral", "3.3.1.3", said, _level(lambda i: double >= least[i])))
    if not ratings:
        raise InputError("no mode to rate: give short_period, phugoid, dutch_roll, roll or spiral")
    return HandlingQualities(aircraft_class, category, tuple(ratings), unrated)


def _short_period(root: complex, n_alpha: float | None, category: str, nimble: bool) -> list[Rating]:
    """Paragraphs 3.2.2.1.1 and 3.2.2.1.2."""
    omega, zeta = abs(root), -root.real / abs(root)
    bounds = _SHORT_PERIOD[category]
    level = _level(lambda i: bounds[i][0] <= zeta <= bounds[i][1])
    ratings = [Rating("short-period damping", "3.2.2.1.2", f"zeta {zeta:.4g}", level)]
    if n_alpha is None:
        return ratings
    if not (math.isfinite(n_alpha) and n_alpha > 0.0):
        raise InputError(f"n_alpha is {n_alpha} g/rad, must be positive and finite")
    cap, limits = omega**2 / n_alpha, _CAP[category]
    slowest, least = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    if category == "A":
        slowest = [1.0, 0.6, 0.0]
    elif category == "C":
        slowest, least = ([0.87, 0.6, 0.0], [2.7, 1.8, 0.0]) if nimble else ([0.7, 0.4, 0.0], [2.0, 1.0, 0.0])
    level = _level(lambda i: limits[i][0] <= cap <= limits[i][1] and omega >= slowest[i] and n_alpha >= least[i])
    value = f"omega {omega:.4g} rad/s, n/alpha {n_alpha:.4g} g/rad, omega^2/(n/alpha) {cap:.4g}"
    return [*ratings, Rating("short-period frequency", "3.2.2.1.1", value, level)]


def _phugoid(root: complex) -> Rating:
    """Paragraph 3.2.1.2: zeta 0.04, zeta 0, time to double 55 s."""
    zeta = -root.real / abs(root)
    double = math.log(2.0) / root.real if root.real > 0.0 else math.inf
    level = _level(lambda i: (zeta >= 0.04, zeta >= 0.0, double >= 55.0)[i])
    return Rating("phugoid", "3.2.1.2", f"zeta {zeta:.4g}", level)


def _dutch_roll(root: complex, aircraft_class: str, category: str) -> Rating:
    """Paragraph 3.3.1.1, table VI: least zeta, zeta omega and omega; class III need not exceed zeta 0.7."""
    omega, zeta = abs(root), -root.real / abs(root)
    if category == "A":
        first = (0.19, 0.35, 1.0 if aircraft_class in ("I", "IV") else 0.4)
    elif category == "B":
        first = (0.08, 0.15, 0.4)
    else:
        first = (0.08, 0.15, 1.0) if aircraft_class in ("I", "II-C", "IV") else (0.08, 0.10, 0.4)
    table = (first, (0.02, 0.05, 0.4), (0.0, -_ANY, 0.4))
    enough = aircraft_class == "III" and zeta >= 0.7

    def meets(i: int) -> bool:
        least_zeta, least_product, slowest = table[i]
        return omega >= slowest and (enough or (zeta >= least_zeta and zeta * omega >= least_product))

    value = f"zeta {zeta:.4g}, omega {omega:.4g} rad/s, zeta omega {zeta * omega:.4g} rad/s"
    return Rating("Dutch roll", "3.3.1.1", value, _level(meets))


def _roll(root: float, category: str, nimble: bool, aircraft_class: str) -> Rating:
    """Paragraph 3.3.1.2, table VII: greatest time constant."""
    if category == "A":
        nimble = aircraft_class in ("I", "IV")
    greatest = (1.0, 1.4, 10.0) if nimble and category != "B" else (1.4, 3.0, 10.0)
    constant = -1.0 / root if root < 0.0 else math.inf
    value = f"time constant {constant:.4g} s" if root < 0.0 else "does not die out"
    return Rating("roll", "3.3.1.2", value, _level(lambda i: constant <= greatest[i]))


def _level(meets: Callable[[int], bool]) -> int | None:
    """The best level whose requirement is met."""
    return next((i + 1 for i in range(3) if meets(i)), None)


def _say(level: int | None) -> str:
    return "worse than level 3" if level is None else f"level {level}"
