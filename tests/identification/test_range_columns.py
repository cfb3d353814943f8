"""The three reductions of a group side by side."""

from dataclasses import replace

import numpy as np
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


def test_a_single_fit_that_fails_is_told() -> None:
    found = reduce_range([measure(flight(), seed=1)], FINNER, model=range_model())
    assert "does not converge" not in found.summary()
    assert "shot 1: the single fit does not converge" in replace(found, single=(None,)).summary()


def test_a_shot_that_linear_theory_refuses_is_named() -> None:
    """Angles all noise: no oscillation to be found."""
    good = measure(flight(), seed=1)
    rng = np.random.default_rng(1)
    still = replace(good, yaw=2e-3 * rng.standard_normal(len(good)), pitch=2e-3 * rng.standard_normal(len(good)))
    with pytest.raises(InputError, match=r"^shot 2: the angles of this record do not oscillate"):
        reduce_range([good, still], FINNER, model=range_model())
