"""Reference tables: read by name, with their sources, and interpolated with an honest error."""

import math

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.reference_data import (
    data_folder,
    find_case,
    finner_arl,
    finner_range,
    finner_range_at,
    read_table,
)


def test_every_table_names_its_source():
    tables = [item.name[:-4] for item in (data_folder() / "reference").iterdir() if item.name.endswith(".csv")]
    assert len(tables) >= 7
    for name in tables:
        assert len(read_table(name).source) > 40, name


def test_range_data_carry_the_printed_probable_error_as_a_standard_deviation():
    table = finner_range().select(mach=1.832)
    damping = table.one("Cm_q+Cm_alphadot")
    assert damping.value == -377.7
    assert 0.6745 * damping.uncertainty == pytest.approx(0.04 * 377.7, rel=1e-4)
    assert table.value("CN_alpha") == 11.78
    assert table.value("CA_0") == 0.585
    assert damping.moment_reference_m[0] == pytest.approx(5.5 * 0.030)
    assert damping.reference_area_m2 == pytest.approx(math.pi * 0.030**2 / 4)


def test_blank_cells_are_left_out_of_single_shots():
    shots = finner_range("shots")
    held = shots.select(name="Cm_q+Cm_alphadot", source="DREV-TM-9703 shots DA95022230")
    assert held.records[0].uncertainty is None
    linear = finner_range("linear")
    assert "CN_alpha" not in linear.select(source="DREV-TM-9703 linear DA95030603").names()


def test_interpolated_range_value_lies_on_the_chord_of_its_neighbours():
    value = finner_range_at(2.0).one("CN_alpha")
    weight = (2.0 - 1.832) / (2.375 - 1.832)
    assert value.value == pytest.approx(11.78 + weight * (10.52 - 11.78))
    assert value.uncertainty > 0.0


def test_interpolation_returns_the_group_at_its_own_mach_number():
    for name in finner_range().names():
        for record in finner_range().select(name=name):
            again = finner_range_at(record.mach).one(name)
            assert again.value == pytest.approx(record.value)
            assert again.uncertainty == pytest.approx(record.uncertainty)


def test_interpolation_refuses_mach_numbers_that_were_not_flown():
    with pytest.raises(InputError, match=r"from M 1.077 to 4.3"):
        finner_range_at(0.8)


def test_arl_cfd_is_marked_as_forced_oscillation_at_its_frequency():
    record = finner_arl().one("Cm_q+Cm_alphadot", mach=2.0)
    assert (record.method, record.k, record.value) == ("fom", 0.1, -341.93)


def test_unknown_table_and_column_are_named():
    with pytest.raises(InputError, match="cone_exact"):
        read_table("cones")
    with pytest.raises(InputError, match="no column 'cnalpha'"):
        read_table("cone_exact").numbers("cnalpha")


def test_exact_plate_table_starts_at_piston_theory():
    table = read_table("plate_supersonic")
    mach, tau, lift = table.numbers("M"), table.numbers("tau"), table.numbers("cl_alpha")
    assert np.allclose(lift[tau == 0.0], 4.0 / mach[tau == 0.0], rtol=1e-6)


def test_packaged_case_is_found_away_from_the_checkout(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for given in ("data/cases/basic_finner_quick.toml", "basic_finner_quick.toml", "basic_finner_quick"):
        assert find_case(given).is_file()
    with pytest.raises(InputError, match=r"no such case file; packaged cases: .*basic_finner_quick\.toml"):
        find_case("elsewhere/basic_finner_quick.toml")
