"""Section data of known shape for the tests."""

import numpy as np

from indicial.cfd.lattice.polars import Polar, PolarTables
from indicial.conventions import Array

ALPHA = np.radians(np.arange(-180.0, 180.01, 0.25))


def linear(slope: float = 2.0 * np.pi, zero_lift: float = 0.0, drag: float = 0.0, moment: float = 0.0) -> Polar:
    """Attached at any incidence."""
    ones = np.ones_like(ALPHA)
    return Polar("flat", 1e6, ALPHA, slope * np.sin(ALPHA - zero_lift), drag * ones, moment * ones)


def stalling(fall: float = 0.6) -> Polar:
    """Attached up to 12 degrees, losing a part of its lift within the next three."""
    angle = np.degrees(np.abs(ALPHA))
    lost = fall * np.clip((angle - 12.0) / 3.0, 0.0, 1.0)
    lift: Array = 2.0 * np.pi * np.sin(ALPHA) * (1.0 - lost)
    return Polar("flat", 1e6, ALPHA, lift, 0.01 + 0.2 * lost, -0.1 * lost * np.sign(ALPHA))


def tables(polar: Polar) -> PolarTables:
    """One polar for all."""
    return PolarTables.of([polar])
