import numpy as np
import pytest

from frontend.place_index import PlaceIndex, compact


def descriptors_of(rng, n=200):
    """Histograms of three times 11 bins that sum to 200 each, as FPFH's do."""
    histograms = rng.gamma(0.5, size=(n, 3, 11))
    return (200 * histograms / histograms.sum(axis=2, keepdims=True)).reshape(n, 33)


def test_a_place_seen_again_has_the_most_votes_among_hundreds():
    rng = np.random.default_rng(0)
    places = [descriptors_of(rng) for _ in range(300)]
    index = PlaceIndex()
    for place in places:
        index.add(place)
    assert len(index) == 300
    for k in (0, 17, 150, 255, 256, 299):
        assert int(np.argmax(index.votes(places[k] + rng.normal(0, 1.0, (200, 33))))) == k


def test_votes_fall_on_the_nearest_by_definition():
    rng = np.random.default_rng(1)
    places = [descriptors_of(rng, 30) for _ in range(7)]
    index = PlaceIndex()
    for place in places:
        index.add(place)
    new = descriptors_of(rng, 20)
    points, owner = np.concatenate([compact(p) for p in places]), np.repeat(np.arange(7), 30)
    distance = np.linalg.norm(compact(new)[:, None] - points[None], axis=2)
    exact = np.bincount(owner[np.argsort(distance, axis=1)[:, :12]].ravel(), minlength=7) / np.sqrt(30)
    # a neighbour up to twice as far may stand in for the nearest
    assert np.abs(index.votes(new) - exact).sum() < 0.3 * exact.sum()
    assert index.votes(new).sum() == pytest.approx(20 * 12 / np.sqrt(30))


def test_places_without_descriptors_are_counted_and_get_no_votes():
    rng = np.random.default_rng(2)
    index = PlaceIndex()
    assert index.votes(descriptors_of(rng)).shape == (0,)
    index.add(np.empty((0, 33)))
    assert index.votes(descriptors_of(rng)).tolist() == [0.0]
    index.add(descriptors_of(rng, 40))
    votes = index.votes(descriptors_of(rng))
    assert votes[0] == 0
    assert votes[1] > 0
    assert index.votes(np.empty((0, 33))).tolist() == [0.0, 0.0]


def test_a_place_with_many_descriptors_is_kept_in_part():
    assert len(compact(np.ones((1000, 33)))) <= 120
    assert len(compact(np.ones((120, 33)))) == 120
    assert compact(np.ones((4, 33))) == pytest.approx(np.zeros((4, 6)), abs=1e-12)  # flat histograms have no waves


def test_the_same_places_give_the_same_votes():
    votes = []
    for _ in range(2):
        rng, index = np.random.default_rng(3), PlaceIndex()
        for _ in range(37):
            index.add(descriptors_of(rng, 50))
        votes.append(index.votes(descriptors_of(rng, 50)))
    assert votes[0].tobytes() == votes[1].tobytes()
