"""Tests of the track table and of GeoJSON."""

import csv
import io
import json
from dataclasses import replace

import numpy as np

from frontend.georeference import Georeference
from sssslam.products.result import Result
from sssslam.products.tracks import format_geojson, format_number, format_table, format_trajectory_csv


def test_unknown_numbers_are_empty_and_zero_has_no_sign() -> None:
    assert [format_number(v) for v in (np.nan, np.inf, -1e-9, 1.5)] == ["", "", "0.000000", "1.500000"]


def test_a_cell_with_a_comma_is_quoted() -> None:
    assert format_table(("a", "b"), [("1,2", "x")]) == 'a,b\n"1,2",x\n'


def test_the_table_has_the_columns_of_the_contract(result: Result) -> None:
    local = format_trajectory_csv(result.trajectory, result.sigmas, None).splitlines()
    assert local[0] == "time,x,y,z,roll,pitch,yaw,sigma_x,sigma_y,sigma_z,sigma_yaw"
    assert len(local) == 1 + len(result.trajectory)
    located = format_trajectory_csv(result.trajectory, result.sigmas, result.recording.georeference)
    assert located.splitlines()[0] == local[0] + ",latitude,longitude"


def test_latitude_and_longitude_lead_back_to_the_place(result: Result) -> None:
    georeference = result.recording.georeference
    assert georeference is not None
    rows = list(csv.DictReader(io.StringIO(format_trajectory_csv(result.trajectory, result.sigmas, georeference))))
    x, y = georeference.to_local([float(r["latitude"]) for r in rows], [float(r["longitude"]) for r in rows])
    # Nine decimals of a degree are 0.1 mm.
    np.testing.assert_allclose(np.column_stack([x, y]), result.trajectory.positions[:, :2], atol=2e-4)


def test_unknown_sigmas_are_empty_cells(result: Result) -> None:
    text = format_trajectory_csv(result.trajectory, np.full_like(result.sigmas, np.nan), None)
    assert text.splitlines()[1].endswith(",,,,")


def test_geojson_has_both_tracks_and_the_accepted_closures(result: Result) -> None:
    anchors = {s.number: T[:2, 3] for s, T in zip(result.submaps, result.T_world_submap, strict=True)}
    tracks = {"corrected": result.trajectory, "dead-reckoned": result.recording.trajectory_dr}
    document = json.loads(format_geojson(tracks, result.loop_closures, anchors, Georeference(58.0, 11.0)))
    names = [feature["properties"]["name"] for feature in document["features"]]
    n_accepted = sum(closure.accepted for closure in result.loop_closures)
    assert names == ["corrected", "dead-reckoned"] + ["loop_closure"] * n_accepted
    # One hundred metres north of the origin: longitude stays, and comes first.
    longitude, latitude = document["features"][0]["geometry"]["coordinates"][0]
    assert abs(longitude - 11.0) < 1e-3
    assert abs(latitude - 58.0) < 1e-3


def test_a_track_of_one_ping_is_a_point(result: Result) -> None:
    document = json.loads(format_geojson({"corrected": result.trajectory[:1]}, (), {}, Georeference(58.0, 11.0)))
    assert document["features"][0]["geometry"]["type"] == "Point"


def test_inputs_stay_as_they_are(result: Result) -> None:
    before = replace(result.trajectory, x=result.trajectory.x.copy())
    format_trajectory_csv(result.trajectory, result.sigmas, None)
    np.testing.assert_array_equal(before.x, result.trajectory.x)
