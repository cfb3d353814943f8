"""Shocks of wedges against tabulated and limiting values."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from indicial.errors import InputError
from indicial.studies.finner.wedge import deflection, detachment_mach, sonic_mach


def test_the_largest_deflection_at_mach_2_is_that_of_the_charts():
    """22.97 degrees (NACA Report 1135, chart 2)."""
    assert detachment_mach(math.radians(22.9735)) == pytest.approx(2.0, abs=1e-5)


def test_no_shock_of_the_mach_number_of_detachment_turns_the_flow_further():
    half_angle = math.atan(0.04)
    mach = detachment_mach(half_angle)
    angles = np.linspace(math.asin(1.0 / mach), 0.5 * math.pi, 5000)
    assert max(deflection(mach, float(angle)) for angle in angles) == pytest.approx(half_angle, rel=1e-6)


def test_at_the_sonic_mach_number_the_flow_behind_the_shock_is_sonic():
    """The Mach number behind from the normal-shock relation across the oblique shock."""
    half_angle, g = math.atan(0.04), 1.4
    mach = sonic_mach(half_angle)
    weak = math.asin(1.0 / mach), math.radians(72.0)
    shock = brentq(lambda angle: deflection(mach, angle) - half_angle, *weak, xtol=1e-12)
    normal = (mach * math.sin(shock)) ** 2
    behind = (1.0 + 0.5 * (g - 1.0) * normal) / (g * normal - 0.5 * (g - 1.0))
    assert math.sqrt(behind) / math.sin(shock - half_angle) == pytest.approx(1.0, abs=1e-6)


def test_thin_wedges_follow_the_transonic_similarity():
    """(M^2 - 1)/((gamma + 1) theta)^(2/3) at detachment tends to 3/2^(4/3)."""
    theta = 1e-5
    parameter = (detachment_mach(theta) ** 2 - 1.0) / (2.4 * theta) ** (2.0 / 3.0)
    assert parameter == pytest.approx(3.0 / 2.0 ** (4.0 / 3.0), rel=1e-3)


@pytest.mark.parametrize("half_angle", [0.0, -0.1, 1.0, math.nan])
def test_other_angles_are_refused(half_angle):
    with pytest.raises(InputError, match="half angle"):
        detachment_mach(half_angle)
