"""The sun stands where geometry and almanacs say."""

import sys
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.refusals import refused

pytest.importorskip('ephem')

from pvibr.shadows.sun import sun_direction, sun_position

UTC = timezone.utc
# Almanac: equinoxes and solstices of 2026, to the minute.
MARCH = datetime(2026, 3, 20, 14, 46, tzinfo=UTC)
JUNE = datetime(2026, 6, 21, 8, 25, tzinfo=UTC)
SEPTEMBER = datetime(2026, 9, 23, 0, 5, tzinfo=UTC)
DECEMBER = datetime(2026, 12, 21, 20, 50, tzinfo=UTC)
TILT = 23.436  # degrees, of the Earth's axis in 2026


def declination(time):
    """At the north pole the sun stands as high as its declination."""
    return sun_position(time, 90, 0)[1]


@pytest.mark.parametrize(
    ('time', 'expected'), [(MARCH, 0), (JUNE, TILT), (SEPTEMBER, 0), (DECEMBER, -TILT)]
)
def test_declination_of_equinoxes_and_solstices(time, expected):
    # 0.0024 degrees: the sun's parallax, at the pole in full. As much again: nutation.
    assert declination(time) == pytest.approx(expected - 0.0024, abs=0.004)


def highest(day, latitude, longitude=0):
    times = [day + timedelta(minutes=m) for m in range(24 * 60)]
    return max((sun_position(t, latitude, longitude) for t in times), key=lambda p: p[1])


@pytest.mark.parametrize('latitude', [-60, -30, 0, 40, 66])
@pytest.mark.parametrize(('solstice', 'tilt'), [(JUNE, TILT), (DECEMBER, -TILT)])
def test_noon_of_the_solstices(latitude, solstice, tilt):
    azimuth, altitude = highest(solstice.replace(hour=0, minute=0), latitude)
    assert altitude == pytest.approx(90 - abs(latitude - tilt), abs=0.02)
    from_south = abs(azimuth - 180)
    assert (from_south < 1) if latitude > tilt else (from_south > 179)


def test_noon_of_the_equinox_at_the_equator_is_overhead():
    noon = datetime(2026, 3, 20, 12, 7, 30, tzinfo=UTC)  # with the equation of time
    assert sun_position(noon, 0, 0)[1] == pytest.approx(90, abs=0.1)
    np.testing.assert_allclose(sun_direction(noon, 0, 0), [0, 0, 1], atol=0.002)


@pytest.mark.parametrize('latitude', [-50, 0, 35, 60])
@pytest.mark.parametrize('time', [JUNE, SEPTEMBER, DECEMBER])
def test_it_rises_where_the_sphere_says(latitude, time):
    """cos(azimuth) = sin(declination) / cos(latitude), without air and size of the sun."""
    day = time.replace(hour=0, minute=0)
    times = [day + timedelta(minutes=m) for m in range(12 * 60)]
    azimuth = min(
        (sun_position(t, latitude, 0) for t in times), key=lambda position: abs(position[1])
    )[0]
    sine = np.sin(np.radians(declination(time))) / np.cos(np.radians(latitude))
    assert azimuth == pytest.approx(np.degrees(np.arccos(sine)), abs=0.5)


times = st.datetimes(datetime(1950, 1, 1), datetime(2100, 1, 1), timezones=st.just(UTC))
places = st.tuples(st.floats(-89, 89), st.floats(-180, 180))


def astronomical_almanac(time, latitude, longitude):
    """The Almanac's low-precision formulas (0.01 degrees from 1950 to 2050), as a direction."""
    n = (time - datetime(2000, 1, 1, 12, tzinfo=UTC)) / timedelta(days=1)
    anomaly = np.radians(357.528 + 0.9856003 * n)
    ecliptic = np.radians(
        280.460 + 0.9856474 * n + 1.915 * np.sin(anomaly) + 0.020 * np.sin(2 * anomaly)
    )
    tilt = np.radians(23.439 - 4e-7 * n)
    x, y, z = np.cos(ecliptic), np.cos(tilt) * np.sin(ecliptic), np.sin(tilt) * np.sin(ecliptic)
    turn = np.radians(280.46062 + 360.98564737 * n + longitude)
    out, east = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    slope = np.radians(latitude)
    north = z * np.cos(slope) - out * np.sin(slope)
    return np.array([east, north, z * np.sin(slope) + out * np.cos(slope)])


@given(times, places)
def test_agrees_with_the_almanac(time, place):
    found = sun_direction(time, *place)
    assert np.linalg.norm(found) == pytest.approx(1)
    apart = np.linalg.norm(found - astronomical_almanac(time, *place))
    assert np.degrees(apart) < 0.03


@given(times, places, st.integers(-12, 12))
def test_time_zones_name_the_same_time(time, place, hours):
    elsewhere = time.astimezone(timezone(timedelta(hours=hours)))
    assert sun_position(elsewhere, *place) == sun_position(time, *place)
    assert sun_position(time, place[0], place[1] % 360) == pytest.approx(
        sun_position(time, *place), abs=1e-6
    )


def test_axes_of_the_scene():
    where = JUNE, 47, 8
    azimuth, altitude = np.radians(sun_position(*where))
    east, north, up = sun_direction(*where)
    assert np.arctan2(east, north) % (2 * np.pi) == pytest.approx(azimuth)
    assert np.arcsin(up) == pytest.approx(altitude)
    # y up, as models have it; north is -z and east stays x.
    turned = sun_direction(*where, north=(0, 0, -2), up=(0, 3, 0))
    np.testing.assert_allclose(turned, [east, up, -north], atol=1e-12)
    # A leaning north is laid flat.
    np.testing.assert_allclose(sun_direction(*where, north=(0, 1, 5)), [east, north, up])


def test_below_the_horizon_it_points_down():
    midnight = datetime(2026, 12, 21, 0, tzinfo=UTC)
    assert sun_position(midnight, 50, 0)[1] < -60
    assert sun_direction(midnight, 50, 0)[2] < -0.8


def test_bad_input_is_named(monkeypatch):
    refused(r'must have a time zone.*timezone\.utc', sun_position, datetime(2026, 1, 1), 0, 0)
    refused(r'datetime\.datetime', sun_position, '2026-01-01', 0, 0, kind=TypeError)
    for latitude in (91, -91, np.nan):
        refused('latitude', sun_position, JUNE, latitude, 0)
    refused('longitude', sun_position, JUNE, 0, 361)
    refused('parallel', sun_direction, JUNE, 0, 0, north=(0, 0, 1))
    refused('up must', sun_direction, JUNE, 0, 0, up=(0, 0, 0))
    monkeypatch.setitem(sys.modules, 'ephem', None)
    refused(r'pvibr\[sun\]', sun_position, JUNE, 0, 0, kind=ImportError)
