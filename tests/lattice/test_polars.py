"""Polars: values given back, carried beyond their range as a plate, refused where there are none."""

import math
from pathlib import Path

import numpy as np
import pytest

from indicial.cfd.lattice.polars import GRID, NeuralFoil, Polar, PolarTables, plate_loads
from indicial.cfd.shapes import WingSection
from indicial.errors import InputError

DEGREES = np.arange(-12.0, 18.5, 0.5)
SECTION = WingSection.naca("0012")


def polar(reynolds: float = 1e6, slope: float = 6.0, name: str = "naca0012") -> Polar:
    alpha = np.radians(DEGREES)
    return Polar(name, reynolds, alpha, slope * np.sin(alpha), 0.01 + alpha**2, -0.1 * alpha)


def test_polar_carried_all_round_has_its_values_within_its_range() -> None:
    full = polar().full
    for name in ("cl", "cd", "cm"):
        here = np.interp(polar().alpha, GRID, getattr(full, name))
        np.testing.assert_allclose(here, getattr(polar(), name), atol=1e-12)


def test_polar_is_a_plate_far_beyond_its_range_and_continuous_between() -> None:
    full = polar().full
    far = np.abs(GRID) > math.radians(28.5)
    for values, plate in zip((full.cl, full.cd, full.cm), plate_loads(GRID), strict=True):
        np.testing.assert_allclose(values[far], plate[far], atol=1e-12)
        assert np.max(np.abs(np.diff(values))) < 0.06


def test_plate_pushes_along_its_normal_and_the_same_from_both_sides() -> None:
    alpha = np.radians(np.linspace(1.0, 179.0, 50))
    cl, cd, cm = plate_loads(alpha)
    np.testing.assert_allclose(cl * np.sin(alpha), cd * np.cos(alpha), atol=1e-14)
    mirrored = plate_loads(-alpha)
    np.testing.assert_allclose(mirrored, [-cl, cd, -cm], atol=1e-14)
    # Hoerner's plate across the wind, pushed at its middle
    across = [float(value) for value in plate_loads(np.array(math.pi / 2.0))]
    assert across[1] == pytest.approx(1.0 / 0.505)
    assert across[2] == pytest.approx(-0.25 / 0.505)


def test_range_is_told_incidence_by_incidence() -> None:
    assert polar().covers(np.radians([-13.0, -12.0, 0.0, 18.0, 18.1])).tolist() == [False, True, True, True, False]


def test_tables_are_linear_in_the_logarithm_of_the_reynolds_number() -> None:
    table = PolarTables.of([polar(4e6, 6.4), polar(1e6, 6.0)])
    middle = table(SECTION, 2e6)
    at = np.radians(5.0)
    assert np.interp(at, middle.alpha, middle.cl) == pytest.approx(6.2 * math.sin(at), rel=1e-6)
    with pytest.raises(InputError, match="outside its polars, 1e\\+06 to 4e\\+06"):
        table(SECTION, 5e6)


def test_section_without_data_is_named() -> None:
    with pytest.raises(InputError, match="section 'naca4412' has no polar data; there are naca0012"):
        PolarTables.of([polar()])(WingSection.naca("4412"), 1e6)


def test_tables_survive_a_file(tmp_path: Path) -> None:
    path = tmp_path / "polars.csv"
    PolarTables.of([polar(), polar(2e6)]).to_csv(path, "made up")
    again = PolarTables.from_csv(path).polars["naca0012"]
    assert [one.reynolds for one in again] == [1e6, 2e6]
    np.testing.assert_allclose(again[0].cl, polar().cl, atol=1e-6)
    assert path.read_text(encoding="utf-8").startswith("# made up\n")


def test_bad_tables_are_refused(tmp_path: Path) -> None:
    alpha = np.radians(DEGREES)
    with pytest.raises(InputError, match="cl must be finite"):
        Polar("a", 1e6, alpha, np.full_like(alpha, np.nan), alpha**2, alpha)
    with pytest.raises(InputError, match="increasing"):
        Polar("a", 1e6, alpha[::-1], alpha, alpha**2, alpha)
    with pytest.raises(InputError, match="cd must be at least 0"):
        Polar("a", 1e6, alpha, alpha, alpha, alpha)
    path = tmp_path / "bad.csv"
    path.write_text("section,alpha_deg\na,1\n", encoding="utf-8")
    with pytest.raises(InputError, match="reynolds, cl, cd, cm not found"):
        PolarTables.from_csv(path)


def test_network_gives_a_thick_section_a_range_and_refuses_a_plate() -> None:
    pytest.importorskip("neuralfoil")
    found = NeuralFoil(size="small")(SECTION, 2e6)
    low, high = found.range
    assert low < math.radians(-8.0) and high > math.radians(12.0)  # noqa: PT018
    # no camber, no preferred side
    np.testing.assert_allclose(found.cl, -np.interp(-found.alpha, found.alpha, found.cl), atol=0.02)
    with pytest.raises(InputError, match="section 'flat' has no polar data"):
        NeuralFoil()(WingSection.flat(), 2e6)
