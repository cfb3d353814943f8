import pickle

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.identification import CHANNEL_UNITS, FlightRecord

TIME = np.arange(11) / 10.0


def record(**changes):
    alpha = np.sin(TIME)
    alpha[3] = np.nan
    parts = {
        "time": TIME,
        "channels": {"alpha": alpha, "V": 100.0 + TIME / 3.0},
        "inputs": {"elevator": 0.1 * np.cos(TIME)},
        "standard_deviations": {"alpha": 1e-3},
        "provenance": {"flight": 7, "pilot": "test"},
    }
    return FlightRecord(**parts | changes)


def assert_equal(one, other):
    np.testing.assert_array_equal(one.time, other.time)
    for kind in ("channels", "inputs"):
        assert list(getattr(one, kind)) == list(getattr(other, kind))
        for name, values in getattr(one, kind).items():
            np.testing.assert_array_equal(values, other[name])
    assert one.standard_deviations == other.standard_deviations
    assert one.provenance == other.provenance


@pytest.mark.parametrize("kind", ["netcdf", "csv"])
def test_files_give_the_record_back_to_the_last_digit(tmp_path, kind):
    path = tmp_path / f"record.{kind}"
    getattr(record(), f"to_{kind}")(path)
    assert_equal(getattr(FlightRecord, f"from_{kind}")(path), record())


def test_every_channel_survives_a_csv_file_under_a_name_with_its_unit(tmp_path):
    whole = FlightRecord(TIME, {name: TIME + i for i, name in enumerate(CHANNEL_UNITS)})
    whole.to_csv(tmp_path / "all.csv")
    assert_equal(FlightRecord.from_csv(tmp_path / "all.csv"), whole)


def test_a_pickled_record_comes_back():
    assert_equal(pickle.loads(pickle.dumps(record())), record())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time": TIME[::-1]}, r"does not increase from row 1 \(1 s\) to row 2 \(0.9 s\)"),
        ({"time": TIME[:1]}, "at least 2 instants"),
        ({"channels": {"alpha": TIME[:5]}}, r"alpha of a flight record has shape \(5,\), time has \(11,\)"),
        ({"channels": {"aoa": TIME}}, "'aoa' is not a channel of flight records; known are x, y, z"),
        ({"channels": {"alpha": np.full(11, np.nan)}}, "at least one channel with data"),
        ({"channels": {}}, "at least one channel with data"),
        ({"channels": {"alpha": np.where(TIME == 0.2, np.inf, 0.0)}}, "infinite in row 3"),
        ({"inputs": {"elevator": np.where(TIME == 0.2, np.nan, 0.0)}}, "input elevator .* missing in row 3"),
        ({"inputs": {"q": TIME}}, "name of a channel"),
        ({"standard_deviations": {"alpha": 0.0}}, "standard deviation of channel alpha is 0.0"),
    ],
)
def test_what_is_no_record_is_refused_by_name(changes, message):
    with pytest.raises(InputError, match=message):
        record(**changes)


def test_a_part_holds_both_its_ends_and_a_part_without_data_is_refused():
    part = record().select(0.2, 0.5)
    np.testing.assert_allclose(part.time, [0.2, 0.3, 0.4, 0.5])
    np.testing.assert_array_equal(part["elevator"], record()["elevator"][2:6])
    with pytest.raises(InputError, match="fewer than two instants"):
        record().select(2.0, 3.0)


def test_data_that_an_analysis_needs_and_the_record_has_not_are_named():
    with pytest.raises(InputError, match="lacks q, az; it has alpha, V, elevator"):
        record().require("alpha", "q", "az")
    dead = record().with_channels(q=np.full(11, np.nan))
    with pytest.raises(InputError, match="channel q of the flight record has no data"):
        dead.require("q")
    assert "q                no data" in dead.summary()


def test_the_summary_tells_range_noise_and_what_is_missing():
    text = record().with_channels(q=np.full(11, 0.1)).summary()
    assert "11 instants over 1 s, 10 Hz" in text
    assert "standard deviation 0.0573, 9.09% missing" in text
    assert "5.73 deg/s, does not change" in text
    assert "elevator" in text


def test_a_plot_has_a_panel_for_each_group_and_one_for_controls():
    assert len(record().plot().axes) == 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,alpha_rad\n0,1\n1,2\n", "not a file of indicial flight record"),
        ("# format: indicial flight record\n# schema_version: 1\ntime_s\n0\n1\n", "a part is missing"),
        ("time_s,alpha_rad\n0,1\n1,deg\n", "row 2 does not hold 2 numbers"),
        ("time_s,alpha_rad\n", "no rows"),
    ],
)
def test_other_files_are_refused_in_a_line(tmp_path, text, message):
    path = tmp_path / "other.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        FlightRecord.from_csv(path)
