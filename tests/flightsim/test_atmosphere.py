import numpy as np
import pytest

from indicial.errors import InputError
from indicial.flightsim import ConstantAtmosphere, StandardAtmosphere, air_at

# U.S. Standard Atmosphere 1976, tables I and III: geometric altitude [m], molecular-scale temperature [K],
# pressure [Pa], density [kg/m^3], speed of sound [m/s].
TABLE = [
    (0.0, 288.150, 1.01325e5, 1.2250, 340.29),
    (1000.0, 281.651, 8.9876e4, 1.1117, 336.43),
    (5000.0, 255.676, 5.4048e4, 7.3643e-1, 320.55),
    (10000.0, 223.252, 2.6500e4, 4.1351e-1, 299.53),
    (20000.0, 216.650, 5.5293e3, 8.8910e-2, 295.07),
    (30000.0, 226.509, 1.1970e3, 1.8410e-2, 301.71),
    (50000.0, 270.650, 7.9779e1, 1.0269e-3, 329.80),
    (70000.0, 219.585, 5.2209, 8.2829e-5, 297.06),
    (86000.0, 186.946, 3.7338e-1, 6.958e-6, 274.10),
]


@pytest.mark.parametrize(("altitude", "temperature", "pressure", "density", "sound"), TABLE)
def test_standard_atmosphere_equals_the_published_tables(
    altitude: float, temperature: float, pressure: float, density: float, sound: float
) -> None:
    air = air_at(StandardAtmosphere(), altitude)
    assert float(air.temperature) == pytest.approx(temperature, abs=2e-3)
    assert float(air.pressure) == pytest.approx(pressure, rel=6e-5)
    assert float(air.density) == pytest.approx(density, rel=6e-5)
    assert float(air.speed_of_sound) == pytest.approx(sound, abs=6e-3)


def test_pressure_is_hydrostatic_across_every_layer() -> None:
    altitude = np.linspace(-4000.0, 85000.0, 200)
    below, here, above = (air_at(StandardAtmosphere(), altitude + step) for step in (-1.0, 0.0, 1.0))
    gravity = 9.80665 * (6356766.0 / (6356766.0 + altitude)) ** 2
    assert -np.log(above.pressure / below.pressure) / 2.0 == pytest.approx(
        gravity * here.density / here.pressure, rel=1e-4
    )


def test_a_warm_day_keeps_pressure_and_thins_the_air() -> None:
    warm, standard = (air_at(StandardAtmosphere(offset), 3000.0) for offset in (20.0, 0.0))
    assert warm.pressure == pytest.approx(standard.pressure)
    assert warm.density * warm.temperature == pytest.approx(standard.density * standard.temperature)
    assert float(warm.temperature - standard.temperature) == pytest.approx(20.0)


def test_range_air_is_20_c_and_1_atm() -> None:
    air = air_at(ConstantAtmosphere(), np.array([0.0, 100.0]))
    assert air.density == pytest.approx(1.2041, rel=1e-4)
    assert air.speed_of_sound == pytest.approx(343.24, abs=0.02)


def test_air_outside_the_standard_is_refused() -> None:
    with pytest.raises(InputError, match="altitude"):
        air_at(StandardAtmosphere(), 90e3)
