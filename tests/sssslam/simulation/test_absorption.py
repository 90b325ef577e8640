import numpy as np
import pytest

from sssslam.simulation.absorption import WaterConfig, absorption

SEA = WaterConfig(temperature=10.0, salinity=35.0, depth=50.0)
# The table names no salinity; in the deep ocean it is 34.6 to 34.7, which its row fits and 35 misses by 0.2 dB/km.
DEEP = WaterConfig(temperature=4.0, salinity=34.6, depth=3000.0)
LAKE = WaterConfig(temperature=15.0, salinity=0.0, depth=5.0)
FREQUENCIES = np.array([100e3, 300e3, 400e3, 455e3, 600e3, 900e3])


@pytest.mark.parametrize(
    ("water", "published"),
    [
        (SEA, [33.4, 72.8, 95.7, 110.6, 158.6, 298.6]),
        (DEEP, [18.1, 50.4, 75.8, 92.8, 147.8, 309.5]),
        (LAKE, [2.6, 23.4, 41.5, 53.7, 93.4, 210.2]),
    ],
)
def test_absorption_is_that_of_francois_and_garrison(water: WaterConfig, published: list[float]) -> None:
    # Their equations evaluated independently, dB/km to one decimal.
    np.testing.assert_allclose(1e3 * absorption(FREQUENCIES, water), published, atol=0.06)


def test_water_warmer_than_twenty_degrees_continues_without_a_step() -> None:
    below, above = (float(absorption(900e3, WaterConfig(temperature=t))) for t in (20.0, 20.001))
    assert above == pytest.approx(below, rel=2e-3)


def test_viscosity_alone_remains_in_fresh_water() -> None:
    quiet = absorption(np.array([200e3, 400e3]), LAKE)
    assert quiet[1] / quiet[0] == pytest.approx(4.0, rel=1e-6)
