"""The three reductions of a group side by side."""

import pytest

from flightsim.support import FINNER
from identification.support import TRUTH, flight, range_model
from indicial.errors import InputError
from indicial.identification import measure, reduce_range


def test_columns_are_the_fits_they_stand_for_and_the_multiple_fit_is_the_surest() -> None:
    shots = [measure(flight(), seed=seed) for seed in (1, 2)]
    found = reduce_range(shots, FINNER, model=range_model())
    rows = found.rows()
    assert [(r["shot"], r["reduction"]) for r in rows] == [
        ("shot 1", "linear"), ("shot 1", "single"), ("shot 2", "linear"), ("shot 2", "single"), ("all", "multiple"),
    ]  # fmt: skip
    best = rows[-1]
    for name, value in TRUTH.items():
        if name == "Cl_p":
            continue
        error = best[f"{name}_pe_pct"] / 100.0 * abs(best[name]) / 0.6745
        assert abs(best[name] - value) < 4.0 * error, name
        assert best[f"{name}_pe_pct"] < rows[1][f"{name}_pe_pct"], name
    assert rows[0]["CA_0"] == found.linear[0].value("CA_0")
    text = found.summary()
    assert "multiple" in text
    assert "probable errors" in text
    with pytest.raises(InputError, match="at least one record"):
        reduce_range([], FINNER)
