import math

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.identification import read_flight_record

TABLE = """# a flight
Time,AOA [deg],TAS,Nz,pitch rate,DE
0,-2.5,100,1.0,0.1,1
100,-2.4,,1.1,0.2,2
200,x,102,1.2,0.3,3
300,-2.0,103,1.3,0.4,4
"""
MAP = """
[time]
column = "Time"
unit = "ms"
[channels]
q = "pitch rate"
[channels.alpha]
column = "AOA [deg]"
unit = "deg"
sign = -1
scale = 2.0
offset = 0.5
[channels.V]
column = "TAS"
unit = "kt"
[channels.az]
column = "Nz"
unit = "g"
sign = -1
[inputs.elevator]
column = "DE"
unit = "deg"
[standard_deviations]
alpha = 0.002
"""


@pytest.fixture
def files(tmp_path):
    def write(table=TABLE, columns=MAP):
        (tmp_path / "flight.csv").write_text(table)
        (tmp_path / "map.toml").write_text(columns)
        return tmp_path / "flight.csv", tmp_path / "map.toml"

    return write


def test_columns_become_channels_in_si_units_and_radians(files):
    record = read_flight_record(*files())
    np.testing.assert_allclose(record.time, [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(record["alpha"], np.radians([5.5, 5.3, np.nan, 4.5]))
    np.testing.assert_allclose(record["V"], np.array([100.0, np.nan, 102.0, 103.0]) * 1852.0 / 3600.0)
    np.testing.assert_allclose(record["az"], -9.80665 * np.array([1.0, 1.1, 1.2, 1.3]))
    np.testing.assert_allclose(record["q"], [0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(record["elevator"], np.radians([1.0, 2.0, 3.0, 4.0]))
    assert record.standard_deviations == {"alpha": 0.002}


def test_a_late_channel_is_moved_back_and_a_dictionary_serves_as_map(files):
    path, _ = files()
    shifted = {"column": "pitch rate", "time_shift": 0.05}
    record = read_flight_record(path, {"time": {"column": "Time", "unit": "ms"}, "channels": {"q": shifted}})
    np.testing.assert_allclose(record["q"], [0.15, 0.25, 0.35, np.nan])


def test_decimal_commas_are_read(files):
    path, _ = files("t;q\n0,0;0,5\n0,1;0,6\n")
    np.testing.assert_allclose(read_flight_record(path, {"time": "t", "channels": {"q": "q"}})["q"], [0.5, 0.6])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"TAS"', '"IAS"', "V: flight.csv has no column 'IAS'; there are 'Time', 'AOA"),
        ('unit = "kt"', 'unit = "deg"', "unit of V is 'deg'; allowed: m/s, km/h, kt, ft/s"),
        ('unit = "kt"', 'units = "kt"', "channels.V.*units: unknown key"),
        ("[channels.V]", "[channels.speed]", "'speed' is not a channel"),
        ('unit = "deg"\nsign', 'unit = "rad"\nsign', "alpha: column 'AOA .deg.' is in deg by its name, not rad"),
        ("[time]", "[tyme]", "time: missing"),
        ("sign = -1\nscale", "sign = -2\nscale", "channels.alpha.*sign"),
    ],
)
def test_what_is_wrong_with_a_map_is_named(files, old, new, message):
    with pytest.raises(InputError, match=message):
        read_flight_record(*files(columns=MAP.replace(old, new)))


def test_degrees_read_as_radians_are_noticed_by_their_size(files):
    path, _ = files("t,theta,q\n0,10,90\n1,12,80\n")
    for channel, size in (("theta", "12 rad"), ("q", "90 rad/s")):
        with pytest.raises(InputError, match=f"{channel} reaches {size}, more than is plausible .* are they deg"):
            read_flight_record(path, {"time": "t", "channels": {channel: channel}})
    right = {"time": "t", "channels": {"theta": {"column": "theta", "unit": "deg"}}}
    assert read_flight_record(path, right)["theta"][0] == pytest.approx(math.radians(10.0))


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("t,q\n0,1\n0,2\n", "does not increase from row 1"),
        ("t,q\n0,a\n1,b\n", "needs a line of column names"),
        ("t,q,q\n0,1,2\n1,2,3\n", "'q' is there twice"),
        ("t,q,p\n0,nan,1\n1,nan,2\n", "'q' .q. holds no number"),
    ],
)
def test_damaged_tables_are_refused(files, table, message):
    path, _ = files(table)
    with pytest.raises(InputError, match=message):
        read_flight_record(path, {"time": "t", "channels": {"q": "q"}})


def test_a_roll_angle_that_counts_turns_is_read_where_its_unit_is_stated(tmp_path):
    rows = "\n".join(f"{0.1 * i:.1f},{90.0 * i:.1f}" for i in range(20))
    (tmp_path / "roll.csv").write_text(f"t,roll\n{rows}\n")
    stated = {"time": "t", "channels": {"phi": {"column": "roll", "unit": "deg"}}}
    record = read_flight_record(tmp_path / "roll.csv", stated)
    assert record["phi"][-1] == pytest.approx(math.radians(19 * 90.0))
    with pytest.raises(InputError, match="more than is plausible"):
        read_flight_record(tmp_path / "roll.csv", {"time": "t", "channels": {"phi": "roll"}})
