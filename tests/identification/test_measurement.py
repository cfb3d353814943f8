import math
from dataclasses import replace

import numpy as np
import pytest

from identification.support import flight, fly_range
from indicial.errors import InputError
from indicial.identification import Precision, RangeRecord, measure


def small_record(**changed):
    n = 15
    time = np.linspace(0.0, 0.3, n)
    values = {"time": time, "x": 700.0 * time, **{name: 0.01 * np.sin(time) for name in ("y", "z", "yaw", "pitch")}}
    return RangeRecord(**(values | changed))


def test_without_noise_a_record_holds_the_flight_at_the_stations():
    places = np.linspace(5.0, 220.0, 20)
    record = measure(flight(), places, seed=None)
    seen = flight().at_stations(places)
    np.testing.assert_allclose(record.x, places, atol=1e-9)
    np.testing.assert_array_equal(record.values[:, 1:3], seen.position[:, 1:])
    np.testing.assert_array_equal(record.values[:, 3:], seen.euler[:, :2])


def test_noise_has_the_stated_standard_deviations_and_is_independent():
    precision = Precision(position=2e-3, angle=math.radians(0.2), roll=math.radians(3.0))
    exact = measure(flight(), 1000, seed=None, roll=True)
    noise = measure(flight(), 1000, seed=4, precision=precision, roll=True).values - exact.values
    scaled = noise / precision.of(exact.channels)
    # standard deviations of a thousand normal numbers scatter by 2.2%, their correlations by 3.2%
    np.testing.assert_allclose(scaled.std(axis=0), 1.0, atol=0.1)
    np.testing.assert_allclose(np.corrcoef(scaled.T), np.eye(6), atol=0.15)


def test_the_same_seed_gives_the_same_record_and_another_seed_another():
    one, same, other = (measure(flight(), 20, seed=seed).values for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, same)
    assert np.all(one != other)


@pytest.mark.parametrize("roll", [False, True])
def test_csv_and_netcdf_round_trips_are_exact(tmp_path, roll):
    record = measure(flight(), 20, seed=1, roll=roll)
    record.to_csv(tmp_path / "record.csv")
    record.to_netcdf(tmp_path / "record.nc")
    for back in (RangeRecord.from_csv(tmp_path / "record.csv"), RangeRecord.from_netcdf(tmp_path / "record.nc")):
        np.testing.assert_array_equal(back.time, record.time)
        np.testing.assert_array_equal(back.values, record.values)
        assert (back.channels, back.precision, back.provenance) == (
            record.channels,
            record.precision,
            record.provenance,
        )


def test_a_plain_csv_in_degrees_with_columns_in_any_order_is_read(tmp_path):
    record = small_record()
    rows = ["note,pitch_deg,yaw_deg,z_m,y_m,x_m,time_s"]
    for i in range(len(record)):
        angles = f"{math.degrees(record.pitch[i])!r},{math.degrees(record.yaw[i])!r}"
        rows.append(
            f"a,{angles},{float(record.z[i])!r},{float(record.y[i])!r},{float(record.x[i])!r},{float(record.time[i])!r}"
        )
    path = tmp_path / "user.csv"
    path.write_text("\n".join(rows))
    back = RangeRecord.from_csv(path, Precision(position=5e-3))
    np.testing.assert_allclose(back.values, record.values, rtol=1e-14)
    assert back.precision.position == 5e-3
    with pytest.raises(InputError, match="precision"):
        RangeRecord.from_csv(path)


def test_a_column_or_number_missing_from_a_file_is_named(tmp_path):
    path = tmp_path / "bad.csv"
    small_record().to_csv(path)
    text = path.read_text()
    path.write_text(text.replace("pitch_rad", "pitch"))
    with pytest.raises(InputError, match="lacks column pitch"):
        RangeRecord.from_csv(path)
    lines = text.splitlines()
    lines[7] = lines[7].replace(lines[7].split(",")[2], "oops")
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"column y_m, station 3 is 'oops'"):
        RangeRecord.from_csv(path)
    path.write_text(text.replace("schema_version: 1", "schema_version: 99"))
    with pytest.raises(InputError, match="schema version 1"):
        RangeRecord.from_csv(path)


def test_bad_records_are_refused_in_words():
    record = small_record()
    gap = record.yaw.copy()
    gap[6] = np.nan
    with pytest.raises(InputError, match="column yaw, station 7"):
        replace(record, yaw=gap)
    back = record.time.copy()
    back[4] = back[2]
    with pytest.raises(InputError, match=r"column time .* station 4 to 5"):
        replace(record, time=back)
    with pytest.raises(InputError, match="10 stations, at least 12"):
        small_record(**{name: getattr(record, name)[:10] for name in ("time", *record.channels)})
    with pytest.raises(InputError, match="column pitch"):
        replace(record, pitch=record.pitch[:-1])
    with pytest.raises(InputError, match="precision of angle"):
        Precision(angle=0.0)
    with pytest.raises(InputError, match="at least 12"):
        measure(flight(), 5, seed=1)
    with pytest.raises(InputError, match="stations must be within"):
        measure(flight(), np.linspace(0.0, 300.0, 20), seed=1)


def test_roll_is_measured_within_half_a_turn():
    record = measure(fly_range(roll_rate=300.0), seed=None, roll=True)
    assert record.channels[-1] == "roll"
    assert np.max(np.abs(record.roll)) <= math.pi
    assert np.max(np.abs(np.diff(record.roll))) > math.pi


def test_summary_and_plot_say_what_was_measured():
    import matplotlib.pyplot as plt

    record = measure(flight(), seed=1)
    assert "54 stations" in record.summary()
    assert "0.1 deg" in record.summary()
    figure = record.plot()
    assert len(figure.axes) == 2
    plt.close(figure)
