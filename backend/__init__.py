"""From relative poses to a trajectory: dead reckoning, pose graph, consistency of loop closures."""
