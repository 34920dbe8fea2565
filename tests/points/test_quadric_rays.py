"""Rays meet quadrics where points on rays and surfaces say."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from pvibr.points.quadric_rays import CAPS, meet_cylinders, meet_ellipsoids, meet_spheres

RNG = np.random.default_rng(0)


def distance_to_cylinder(points, half, radius, caps):
    """Return signed distances of points from a cylinder about the origin, below 0 inside."""
    length = np.linalg.norm(half)
    unit = half / length
    up = points @ unit
    out = np.linalg.norm(points - up[..., None] * unit, axis=-1)
    if caps == 'round':
        beyond = np.maximum(np.abs(up) - length, 0)
        return np.hypot(beyond, out) - radius
    return np.maximum(np.abs(up) - length, out - radius)


def rays(count=4000, spread=3.0):
    ways = RNG.normal(size=(count, 3)) * RNG.uniform(0.1, 10, (count, 1))
    aims = RNG.uniform(-1.5, 1.5, (count, 3))
    return aims - spread * ways, ways


def check(met, starts, ways, signed):
    """Check that hits lie on a surface, with its normal, and that misses never come near it."""
    assert 0.05 < met.hits[0].mean() < 0.95
    for k, sign in ((0, -1), (1, 1)):
        hit = met.hits[k]
        points = starts[hit] + met.distances[k][hit, None] * ways[hit]
        assert np.abs(signed(points)).max() < 1e-9
        normals = met.normals[k][hit]
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-12)
        assert (np.sign((normals * ways[hit]).sum(1)) == sign).mean() > 0.999
        step = 1e-6
        slope = (signed(points + step * normals) - signed(points - step * normals)) / (2 * step)
        assert (slope > 0.3).mean() > 0.999
    t = np.linspace(0, 6, 1500)[:, None, None]
    missed = ~met.hits[0]
    assert (signed(starts[missed] + t * ways[missed]) > -1e-9).all()


@pytest.mark.parametrize('caps', ['flat', 'round'])
def test_cylinders_are_met_on_their_surface(caps):
    starts, ways = rays()
    half = np.array([0.3, -0.8, 0.5])
    met = meet_cylinders(starts, ways, np.zeros(3), half, 0.4, caps)
    check(met, starts, ways, partial(distance_to_cylinder, half=half, radius=0.4, caps=caps))


def test_open_cylinders_are_met_on_their_wall_alone():
    starts, ways = rays()
    half = np.array([0.3, -0.8, 0.5])
    flat = meet_cylinders(starts, ways, np.zeros(3), half, 0.4)
    found = meet_cylinders(starts, ways, np.zeros(3), half, 0.4, None)
    assert not (found.hits & ~flat.hits).any()
    both = found.hits
    np.testing.assert_allclose(found.distances[both], flat.distances[both])
    through_an_end = flat.hits[0] & ~found.hits[0]
    along = np.abs((flat.normals[0] * half).sum(-1)) / np.linalg.norm(half)
    np.testing.assert_allclose(along[through_an_end], 1)
    assert through_an_end.sum() > 50


def test_ellipsoids_are_met_on_their_surface():
    starts, ways = rays()
    turn = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
    radii = np.array([1.2, 0.5, 0.8])

    def signed(points):
        local = points @ turn / radii
        return (np.linalg.norm(local, axis=-1) - 1) * radii.min()

    met = meet_ellipsoids(starts, ways, np.zeros(3), turn * radii)
    check(met, starts, ways, signed)


def test_the_first_hit_from_within_is_the_inside():
    met = meet_spheres([0, 0, 0], [0, 0, -1], [0, 0, 0], 2.0)
    distance, normal, inside = met.first()
    assert (float(distance), bool(inside)) == (2.0, True)
    np.testing.assert_allclose(normal, [0, 0, 1])


@pytest.mark.parametrize('caps', CAPS)
def test_rays_along_the_axis(caps):
    starts = np.array([[0, 0, 9.0], [0, 0.999, 9.0], [0, 1.001, 9.0]])
    met = meet_cylinders(starts, [0, 0, -1.0], np.zeros(3), [0, 0, 2.0], 1.0, caps)
    assert met.hits[0].tolist() == [caps is not None] * 2 + [False]
    if caps == 'flat':
        np.testing.assert_allclose(met.distances[:, :2].T, [[7, 11]] * 2)
    elif caps == 'round':
        np.testing.assert_allclose(met.distances[:, 0], [6, 12])


@pytest.mark.parametrize(('caps', 'seen'), [('flat', False), ('round', True), (None, False)])
def test_cylinders_without_length(caps, seen):
    met = meet_cylinders([0, 0, 5.0], [0, 0.01, -1], np.zeros(3), np.zeros(3), 1.0, caps)
    assert met.hits.tolist() == [seen] * 2
    ball = meet_spheres([0, 0, 5.0], [0, 0.01, -1], np.zeros(3), 1.0)
    if seen:
        np.testing.assert_allclose(met.distances, ball.distances)
        np.testing.assert_allclose(met.normals, ball.normals, atol=1e-12)


@pytest.mark.parametrize('scale', [1e-9, 1e9])
def test_scale_changes_nothing(scale):
    starts, ways = rays(500)
    half = np.array([0.3, -0.8, 0.5])
    for caps in CAPS:
        one = meet_cylinders(starts, ways, np.zeros(3), half, 0.4, caps)
        other = meet_cylinders(starts * scale, ways, np.zeros(3), half * scale, 0.4 * scale, caps)
        assert (one.hits == other.hits).all()
        hit = one.hits
        np.testing.assert_allclose(other.distances[hit], one.distances[hit] * scale, rtol=1e-6)
