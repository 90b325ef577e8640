import numpy as np
import pytest

from frontend.arrays import FloatArray
from sssslam.simulation.speckle import SpeckleConfig, SpeckleSource

SPACING = (0.4, 0.05)


def _source(seed: int = 0, **values: float) -> SpeckleSource:
    return SpeckleSource(SpeckleConfig(**values), SPACING, np.random.default_rng(seed))


def _lagged(intensity: FloatArray, axis: int, lag: int) -> float:
    """Correlation of the intensity with itself some samples on."""
    moved = np.moveaxis(intensity, axis, 0)
    return float(np.corrcoef(moved[lag:].ravel(), moved[:-lag].ravel())[0, 1])


@pytest.mark.parametrize("looks", [1.0, 2.5, 4.0])
def test_speckle_has_mean_one_and_variance_one_over_looks(looks: float) -> None:
    speckle = _source(looks=looks).speckle(400, 1000)
    # 4e5 samples: 1 sigma of the mean 0.0016, of the variance about 0.5 %.
    assert speckle.mean() == pytest.approx(1.0, abs=0.008)
    assert speckle.var() == pytest.approx(1 / looks, rel=0.03)


def test_single_look_speckle_is_exponential() -> None:
    speckle = _source().speckle(200, 1000)
    for level in (0.1, 1.0, 3.0):
        assert (speckle > level).mean() == pytest.approx(np.exp(-level), abs=0.005)


@pytest.mark.parametrize("shape", [2.0, 8.0])
def test_k_speckle_has_the_moments_of_the_k_distribution(shape: float) -> None:
    source = _source(shape=shape)
    intensity = source.texture(400, 1000) * source.speckle(400, 1000)
    # E[I^2] / E[I]^2 = (1 + 1/L)(1 + 1/nu)
    assert (intensity**2).mean() / intensity.mean() ** 2 == pytest.approx(2 * (1 + 1 / shape), rel=0.04)


def test_texture_is_one_without_a_k_distribution() -> None:
    assert np.array_equal(_source().texture(2, 3), np.ones((2, 3)))


def test_white_speckle_knows_nothing_of_its_neighbours() -> None:
    speckle = _source().speckle(300, 1000)
    assert abs(_lagged(speckle, 1, 1)) < 0.01
    assert abs(_lagged(speckle, 0, 1)) < 0.01


def test_speckle_correlates_in_range_as_asked() -> None:
    speckle = _source(range_correlation=0.2).speckle(300, 1000)
    assert speckle.mean() == pytest.approx(1.0, abs=0.02)
    assert speckle.var() == pytest.approx(1.0, rel=0.06)
    # exp(-(lag / length)^2) with a length of four samples
    for lag in (2, 4, 8):
        assert _lagged(speckle, 1, lag) == pytest.approx(np.exp(-((lag / 4) ** 2)), abs=0.03)
    assert abs(_lagged(speckle, 0, 1)) < 0.02


def test_speckle_correlates_along_the_track_as_asked() -> None:
    speckle = _source(track_correlation=0.8, looks=2.0).speckle(600, 500)
    assert speckle.var() == pytest.approx(0.5, rel=0.06)
    # exp(-distance / length): pings are 0.4 m apart
    for lag in (1, 2, 4):
        assert _lagged(speckle, 0, lag) == pytest.approx(np.exp(-0.4 * lag / 0.8), abs=0.03)
    assert abs(_lagged(speckle, 1, 1)) < 0.02


@pytest.mark.parametrize(
    "values",
    [{}, {"range_correlation": 0.1}, {"track_correlation": 0.8}, {"range_correlation": 0.1, "track_correlation": 0.5}],
)
def test_speckle_drawn_in_pieces_is_speckle_drawn_at_once(values: dict[str, float]) -> None:
    whole, pieces = _source(shape=3.0, **values), _source(shape=3.0, **values)
    once = whole.texture(30, 64), whole.speckle(30, 64)
    several = [(pieces.texture(n, 64), pieces.speckle(n, 64)) for n in (1, 7, 22)]
    for k in (0, 1):
        np.testing.assert_array_equal(np.concatenate([piece[k] for piece in several]), once[k])


def test_correlated_speckle_wants_whole_looks() -> None:
    with pytest.raises(ValueError, match=r"correlated speckle wants a whole number of looks, got 1\.5"):
        SpeckleConfig(looks=1.5, range_correlation=0.1)
