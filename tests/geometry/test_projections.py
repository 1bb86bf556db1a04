"""The contract of every projection in the registry, and the values that its name promises."""

import numpy as np
import pytest

from panostitch.geometry.projections import PROJECTIONS
from tolerances import RELATIVE, UNIT

COUNT = 2000

# share of random rays that a projection must show, or the tests below would test nothing: rectilinear shows half
LEAST_SHOWN = 0.4

# plane units; all projections show so much around straight ahead
PLANE_EXTENT = 1.2

# radians; a step straight ahead, whose square (1e-10) is the error of taking the projection for linear there
STEP, STEP_ERROR = 1e-5, 1e-9

# rays this far from where a projection ends may be on either side of its end
MARGIN = 1e-3


@pytest.fixture(params=sorted(PROJECTIONS))
def projection(request):
    return PROJECTIONS[request.param]


@pytest.fixture
def rays(rng):
    """Unit vectors all around."""
    vectors = rng.normal(size=(COUNT, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_inverse_undoes_forward(projection, rays):
    plane = projection.forward(rays)
    shown = np.isfinite(plane).all(1)
    assert shown.mean() > LEAST_SHOWN

    back = projection.inverse(plane[shown])

    back /= np.linalg.norm(back, axis=1, keepdims=True)
    np.testing.assert_allclose(back, rays[shown], rtol=0, atol=UNIT)


def test_forward_undoes_inverse(projection, rng):
    plane = rng.uniform(-PLANE_EXTENT, PLANE_EXTENT, (COUNT, 2))

    np.testing.assert_allclose(projection.forward(projection.inverse(plane)), plane, rtol=0, atol=UNIT)


def test_straight_ahead_is_the_origin(projection):
    np.testing.assert_array_equal(projection.forward(np.array([[0.0, 0.0, 1.0]])), [[0, 0]])


def test_right_and_down_in_units_of_the_focal_length(projection):
    steps = projection.forward(np.array([[STEP, 0, 1], [0, STEP, 1]]))

    np.testing.assert_allclose(steps, [[STEP, 0], [0, STEP]], rtol=0, atol=STEP_ERROR * STEP)


def test_the_length_of_a_ray_does_not_matter(projection, rays):
    np.testing.assert_allclose(projection.forward(rays * 250), projection.forward(rays), rtol=RELATIVE)


@pytest.mark.parametrize("projection", [p for p in PROJECTIONS.values() if p.period])
def test_a_full_turn_has_the_promised_width(projection, rng):
    plane = rng.uniform(-PLANE_EXTENT, PLANE_EXTENT, (COUNT, 2))

    turned = projection.inverse(plane + np.array([projection.period, 0]))

    np.testing.assert_allclose(turned, projection.inverse(plane), rtol=0, atol=UNIT)
    # and nothing less than that is a full turn
    half = projection.inverse(plane + np.array([projection.period / 2, 0]))
    np.testing.assert_allclose(half[:, [0, 2]], -projection.inverse(plane)[:, [0, 2]], rtol=0, atol=UNIT)


def test_what_is_nowhere_stays_nowhere(projection):
    assert np.isnan(projection.forward(np.full((1, 3), np.nan))).any()
    assert np.isnan(projection.inverse(np.full((1, 2), np.nan))).any()


def test_nothing_in_nothing_out(projection):
    assert projection.forward(np.empty((0, 3))).shape == (0, 2)
    assert projection.inverse(np.empty((0, 2))).shape == (0, 3)


def from_angles(longitude, latitude):
    return np.array([[np.sin(longitude) * np.cos(latitude), np.sin(latitude), np.cos(longitude) * np.cos(latitude)]])


@pytest.mark.parametrize("longitude", [-1.2, -0.3, 0.0, 0.7, 1.3])
@pytest.mark.parametrize("latitude", [-1.0, 0.0, 0.4])
def test_known_values(longitude, latitude):
    ray = from_angles(longitude, latitude)
    expected = {
        "rectilinear": (np.tan(longitude), np.tan(latitude) / np.cos(longitude)),
        "cylindrical": (longitude, np.tan(latitude)),
        "equirectangular": (longitude, latitude),
    }
    for name, plane in expected.items():
        np.testing.assert_allclose(PROJECTIONS[name].forward(ray), [plane], rtol=0, atol=UNIT, err_msg=name)


@pytest.mark.parametrize("longitude", [-3.0, -2.0, 2.0, 3.0])
def test_what_lies_behind_is_shown_on_a_turn_only(longitude):
    ray = from_angles(longitude, 0.2)

    assert np.isnan(PROJECTIONS["rectilinear"].forward(ray)).all()
    for name in ("cylindrical", "equirectangular"):
        np.testing.assert_allclose(PROJECTIONS[name].forward(ray)[0, 0], longitude, atol=UNIT)


def test_rectilinear_ends_at_ninety_degrees():
    just_in, just_out = from_angles(np.pi / 2 - MARGIN, 0), from_angles(np.pi / 2 + MARGIN, 0)

    assert np.isfinite(PROJECTIONS["rectilinear"].forward(just_in)).all()
    assert np.isnan(PROJECTIONS["rectilinear"].forward(just_out)).all()


@pytest.mark.parametrize("pole", [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
def test_the_poles(pole):
    ray = np.array([pole])

    assert np.isnan(PROJECTIONS["cylindrical"].forward(ray)).any()
    np.testing.assert_allclose(PROJECTIONS["equirectangular"].forward(ray)[0, 1], pole[1] * np.pi / 2, atol=UNIT)


@pytest.mark.parametrize("sign", [-1, 1])
def test_equirectangular_shows_nothing_beyond_the_poles(sign):
    beyond, before = sign * (np.pi / 2 + MARGIN), sign * (np.pi / 2 - MARGIN)

    assert np.isnan(PROJECTIONS["equirectangular"].inverse(np.array([[0.3, beyond]]))).any()
    assert np.isfinite(PROJECTIONS["equirectangular"].inverse(np.array([[0.3, before]]))).all()
