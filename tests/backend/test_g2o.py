import gtsam
import numpy as np
import pytest

from backend.factors import between_factor
from backend.g2o import g2o_text
from backend.poses import RelativePose, invert


@pytest.fixture(scope="module")
def solved(make_survey):
    survey, rng = make_survey(0, every=60), np.random.default_rng(0)
    return survey.graph([survey.closure(*pair, rng) for pair in survey.revisits(30.0, 3)]).solve()


def read(solution, tmp_path):
    solution.write_g2o(tmp_path / "graph.g2o")
    return gtsam.readG2o(str(tmp_path / "graph.g2o"), True)


def test_gtsam_reads_the_poses_back(solved, tmp_path):
    _, values = read(solved, tmp_path)
    found = np.stack([values.atPose3(k).matrix() for k in range(values.size())])
    # a quaternion and back costs a few roundings of one
    np.testing.assert_allclose(found, solved.T_world_anchor, rtol=0, atol=1e-12)


def test_gtsam_reads_the_relative_poses_with_their_information_back(make_survey, tmp_path):
    survey, rng = make_survey(1, every=60), np.random.default_rng(1)
    T, covariance = survey.true_anchors, np.diag([0.01, 0.02, 0.03, 0.4, 0.5, 0.6]) ** 2
    relative_poses = [*survey.odometry(), RelativePose(2, 9, invert(T[2]) @ T[9], covariance)]
    (tmp_path / "graph.g2o").write_text(g2o_text(survey.dr_anchors, relative_poses))
    graph, values = gtsam.readG2o(str(tmp_path / "graph.g2o"), True)
    assert graph.size() == len(relative_poses)
    shaken = gtsam.Values()
    for k in range(values.size()):
        shaken.insert(k, values.atPose3(k).retract(0.01 * rng.normal(size=6)))
    for k, relative in enumerate(relative_poses):
        ours = between_factor(relative)
        assert graph.at(k).keys() == ours.keys()
        assert graph.at(k).error(shaken) == pytest.approx(ours.error(shaken), rel=1e-6)


def test_every_number_reads_back_to_the_same_bits():
    T = np.eye(4)[None].copy()
    T[0, :3, 3] = [1 / 3, 1e-17, 123456.789012345]
    numbers = g2o_text(T, []).splitlines()[0].split()[2:5]
    assert [float(number) for number in numbers] == T[0, :3, 3].tolist()


def test_there_is_no_negative_zero_and_the_quaternion_has_a_positive_real_part():
    T = np.eye(4)
    T[:3, :3], T[1, 3] = np.diag([-1.0, -1.0, 1.0]), -0.0
    turned = np.eye(4)
    turned[:2, :2] = [[np.cos(3.5), -np.sin(3.5)], [np.sin(3.5), np.cos(3.5)]]
    text = g2o_text(np.stack([T, turned]), [])
    assert "-0.0 " not in text
    assert float(text.splitlines()[1].split()[-1]) > 0


def test_a_closure_that_does_not_hold_is_not_written(make_survey):
    survey, rng = make_survey(0), np.random.default_rng(0)
    solution = survey.graph([survey.false_closure(4, 57, np.array([15.0, 15.0, 0.0]), rng)]).solve()
    edges = [line for line in solution.g2o.splitlines() if line.startswith("EDGE")]
    assert len(edges) == len(survey.anchor_pings) - 1
    assert solution.g2o.count("VERTEX_SE3:QUAT") == len(survey.anchor_pings)
