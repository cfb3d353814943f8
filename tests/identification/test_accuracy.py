import numpy as np
import pytest

from indicial.conventions import Array
from indicial.identification.accuracy import cramer_rao, neighbour_test, undetermined


def regressors(n: int) -> Array:
    """Decaying waves and a line, shape (n, 4)."""
    t = np.linspace(0.0, 1.0, n)
    return np.stack([np.exp(-t) * np.sin(40 * t), np.exp(-t) * np.cos(40 * t), np.ones(n), t], axis=1)


def test_the_bound_is_the_inverse_of_the_information_whatever_the_units():
    x = regressors(60)
    units = np.array([1e-6, 1.0, 1e4, 1e9])
    expected = np.linalg.inv(x.T @ x) / np.outer(units, units)
    np.testing.assert_allclose(cramer_rao(x * units), expected, rtol=1e-9)


def test_the_neighbour_test_cries_wolf_as_often_as_it_says():
    n = 54
    x = regressors(n)
    bound = cramer_rao(x)
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((2000, n))
    residuals = noise - noise @ x @ bound @ x.T
    results = [neighbour_test("y", row, x, bound) for row in residuals]
    rate = np.mean([result.probability < 0.05 for result in results])
    assert 0.03 < rate < 0.07
    # the correlation that the fit itself makes is taken out
    assert np.mean([result.neighbours for result in results]) == pytest.approx(0.0, abs=0.01)


def test_derivatives_that_only_act_as_a_sum_are_named_with_their_sum():
    rng = np.random.default_rng(3)
    wave = rng.standard_normal((50, 2))
    x = np.stack([wave[:, 0], wave[:, 0] + 1e-4 * wave[:, 1], rng.standard_normal(50)], axis=1)
    (finding,) = undetermined(("Cm_q", "Cm_alphadot", "CA_0"), np.array([-300.0, -60.0, 0.5]), cramer_rao(x / 0.01))
    assert "cannot separate" in finding
    assert "Cm_q" in finding
    assert "Cm_alphadot" in finding
    assert "identify the sum" in finding
    assert "CA_0" not in finding


def test_what_goes_together_is_named_together_with_the_combination_that_is_told():
    """Two pairs, of which the record tells a + 2 b and c + d - and neither of them by itself."""
    rng = np.random.default_rng(4)
    wave = rng.standard_normal((200, 4))
    little = 1e-4 * rng.standard_normal((200, 2))
    x = np.stack(
        [wave[:, 0], 2.0 * wave[:, 0] + little[:, 0], wave[:, 1], wave[:, 1] + little[:, 1], wave[:, 2]], axis=1
    )
    findings = undetermined(("a", "b", "c", "d", "e"), np.ones(5), cramer_rao(x / 1e-3))
    assert len(findings) == 2
    (one,) = (text for text in findings if "a +-" in text)
    (other,) = (text for text in findings if "c +-" in text)
    assert "it determines a + 2 b, +-" in one or "it determines b + 0.5 a, +-" in one
    assert "their sum" in other
    assert not any("e +-" in text for text in findings)


def test_three_that_go_together_are_one_finding_and_a_strong_scale_hides_none():
    """a + b - c acts on nothing; whatever the units, all three are named and the fourth is not."""
    rng = np.random.default_rng(5)
    wave = rng.standard_normal((200, 3))
    x = np.stack(
        [wave[:, 0], wave[:, 1], wave[:, 0] + wave[:, 1] + 1e-4 * wave[:, 2], rng.standard_normal(200)], axis=1
    )
    for units in (np.ones(4), np.array([1e-3, 1.0, 1e4, 1e6])):
        (finding,) = undetermined(("a", "b", "c", "e"), 1.0 / units, cramer_rao(x * units / 1e-3))
        assert all(f"{name} +-" in finding for name in "abc")
        assert "e +-" not in finding


def test_two_pairs_with_one_in_common_are_one_group():
    rng = np.random.default_rng(6)
    wave = rng.standard_normal((200, 3))
    x = np.stack([wave[:, 0], wave[:, 0] + 1e-4 * wave[:, 1], wave[:, 0] + 1e-4 * wave[:, 2]], axis=1)
    (finding,) = undetermined(("a", "b", "c"), np.ones(3), cramer_rao(x / 1e-3))
    assert all(f"{name} +-" in finding for name in "abc")
    assert finding.count(" + 1 ") == 2


def test_a_derivative_lost_in_its_error_is_named_and_a_good_one_is_not():
    covariance = np.diag([4.0, 1e-4])
    (finding,) = undetermined(("CN_alpha", "CA_0"), np.array([3.0, 0.5]), covariance)
    assert finding.startswith("the record hardly determines CN_alpha")
    assert undetermined(("CN_alpha", "CA_0"), np.array([12.0, 0.5]), covariance) == ()


def test_what_is_close_but_determined_is_not_called_inseparable():
    rng = np.random.default_rng(3)
    wave = rng.standard_normal((50, 2))
    x = np.stack([wave[:, 0], wave[:, 0] + 0.04 * wave[:, 1], rng.standard_normal(50)], axis=1)
    names, values = ("CX_alpha", "CX_alpha^2", "Cm_0"), np.array([1.0, 3.0, 0.5])
    (sure,) = undetermined(names, values, cramer_rao(x / 0.01))
    assert "separates by small differences only" in sure
    told = undetermined(names, values, cramer_rao(x / 1.0))
    assert any("cannot separate" in finding for finding in told)
