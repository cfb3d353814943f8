"""The closing table and its sentence say what the numbers say."""

import pytest

from indicial.conventions import ReferenceQuantities
from indicial.derivatives import Derivative, DerivativeTable
from indicial.motion import FlightCondition
from indicial.report.comparison import comparison, comparison_text, statement
from indicial.report.style import symbol

REFERENCE = ReferenceQuantities(0.03, 7e-4, (0.165, 0.0, 0.0))


def record(name: str, method: str, value: float, **rest) -> Derivative:
    return Derivative.at(FlightCondition(2.0), REFERENCE, name, method, value, "test", **rest)


TABLE = DerivativeTable(
    (
        record("Cm_alpha", "mrf", -22.0),
        record("Cm_alpha", "measured", -20.0, uncertainty=1.0),
        record("Cm_q+Cm_alphadot", "fom", -300.0, reduction="phase_angle", k=0.1),
        record("Cm_q+Cm_alphadot", "fom", -270.0, reduction="fourier", k=0.1),
        record("Cm_q+Cm_alphadot", "measured", -360.0, uncertainty=30.0),
        record("CN_q", "mrf", 90.0),
    )
)


def test_deviation_is_negative_where_the_computed_value_is_too_small_in_size():
    rows = {row.name: row for row in comparison(TABLE)}
    assert rows["Cm_alpha"].deviation("mrf") == pytest.approx(0.10)
    assert rows["Cm_q+Cm_alphadot"].deviation("fom") == pytest.approx(-0.25)
    assert rows["CN_q"].deviation("mrf") is None


def test_forced_oscillation_is_compared_by_its_fourier_reduction():
    rows = {row.name: row for row in comparison(TABLE)}
    assert rows["Cm_q+Cm_alphadot"].records["fom"].value == -270.0


def test_the_operator_stands_beside_each_method_at_its_own_frequency():
    """The oscillation's k as it is computed back from its angular frequency, not to the last digit."""
    name = "Cm_q+Cm_alphadot"
    of_operator = (
        record(name, "operator", -280.0),
        record(name, "operator", -271.0, k=0.1 * (1.0 + 1e-15)),
        record(name, "operator", -250.0, k=0.5),
    )
    table = DerivativeTable((*TABLE, *of_operator))
    row = {row.name: row for row in comparison(table)}[name]
    assert row.records["operator"].value == -280.0
    assert row.records["operator_at_k"].value == -271.0
    assert "operator_at_k" not in {row.name: row for row in comparison(TABLE)}[name].records
    assert "operator -22%" in statement([row], "it")


def test_statement_is_made_from_the_numbers():
    said = statement(comparison(TABLE), "a mesh of 10 cells")
    assert "On a mesh of 10 cells" in said
    assert "Cm_alpha +10% (by MRF, 2.0 standard errors)" in said
    assert "Cm_q+Cm_alphadot -25% (by FOM at k = 0.1, 3.0 standard errors)" in said
    assert "CN_q" not in said
    assert "no computed derivative" in statement(comparison(TABLE.select(method="mrf")), "it")


def test_text_table_has_a_line_for_every_derivative():
    text = comparison_text(comparison(TABLE))
    assert [line.split()[0] for line in text.splitlines()[2:] if not line.startswith("  ")] == [
        "Cm_alpha",
        "CN_q",
        "Cm_q+Cm_alphadot",
    ]
    assert "(-25%)" in text


def test_symbols_are_mathematics():
    assert symbol("Cm_q+Cm_alphadot") == r"$C_{mq}+C_{m\dot{\alpha}}$"
    assert symbol("CA_0") == "$C_{A0}$"
