"""From echoes to loop closures: sonar geometry, inversion, submaps, features, matching, verification."""
