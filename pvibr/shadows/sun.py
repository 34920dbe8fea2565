"""Position of the sun, by PyEphem (extra ``sun``)."""

from __future__ import annotations

import datetime
import math

import numpy as np

from pvibr.core.arguments import checked_direction, checked_number
from pvibr.core.errors import require


def sun_position(time, latitude, longitude):
    """Return azimuth and altitude of the sun in degrees; `time` needs a time zone."""
    _check_time(time)
    checked_number('latitude', latitude, -90, 90)
    checked_number('longitude', longitude, -180, 360)
    ephem = require('ephem', 'sun', 'Positions of the sun')
    observer = ephem.Observer()
    # PyEphem has no time zones: every time is UTC.
    observer.date = ephem.Date(time.astimezone(datetime.timezone.utc).replace(tzinfo=None))
    observer.lat, observer.lon = math.radians(latitude), math.radians(longitude)
    observer.pressure = 0  # no refraction
    sun = ephem.Sun(observer)
    return math.degrees(sun.az), math.degrees(sun.alt)


def sun_direction(time, latitude, longitude, *, north=(0, 1, 0), up=(0, 0, 1)):
    """Return the unit vector toward the sun, (3,), in world space."""
    east, north, up = _axes(north, up)
    azimuth, altitude = np.radians(sun_position(time, latitude, longitude))
    horizontal = np.sin(azimuth) * east + np.cos(azimuth) * north
    return np.cos(altitude) * horizontal + np.sin(altitude) * up


def _check_time(time):
    if not isinstance(time, datetime.datetime):
        raise TypeError(f'time must be a datetime.datetime, got {time!r}')
    if time.utcoffset() is None:
        raise ValueError(
            f'time must have a time zone, got {time}: set tzinfo=datetime.timezone.utc, or '
            "zoneinfo.ZoneInfo('Europe/Zurich')"
        )


def _axes(north, up):
    north, up = checked_direction('north', north), checked_direction('up', up)
    east = np.cross(north, up)
    length = np.linalg.norm(east)
    if length < 1e-6:
        raise ValueError(
            f'north must not be parallel to up, got {north.tolist()} and {up.tolist()}'
        )
    east /= length
    return east, np.cross(up, east), up
