import numpy as np
import pytest

from sssslam.simulation.seabed import Gsab, Lambert, backscatter_table


def test_lambert_falls_with_the_square_of_the_cosine() -> None:
    level = 10 * np.log10(Lambert(strength=-27.0).backscatter(np.radians([0.0, 60.0])))
    assert level.tolist() == pytest.approx([-27.0, -27.0 + 20 * np.log10(0.5)])


def test_gsab_is_specular_at_nadir_and_lambert_far_from_it() -> None:
    law = Gsab(specular=-10.0, specular_width_deg=5.0, strength=-30.0, exponent=2.0)
    level = 10 * np.log10(law.backscatter(np.radians([0.0, 60.0])))
    assert level[0] == pytest.approx(10 * np.log10(0.1 + 0.001))
    assert level[1] == pytest.approx(-30.0 + 20 * np.log10(0.5), abs=1e-6)


@pytest.mark.parametrize("law", [Lambert(), Lambert(exponent=1.0), Gsab()])
def test_the_table_is_the_law_over_its_cosine(law: Lambert | Gsab) -> None:
    table = backscatter_table(law)
    cosine = np.linspace(0.0, 1.0, table.size)[1:]
    np.testing.assert_allclose(table[1:] * cosine, law.backscatter(np.arccos(cosine)))
    assert np.isfinite(table).all()
