"""The contract of every projection in the registry, and the values that its name promises."""

import numpy as np
import pytest

from panostitch.geometry.projections import PROJECTIONS, cube
from tolerances import RELATIVE, UNIT

COUNT = 2000

# share of random rays that a projection must show, or the tests below would test nothing: rectilinear shows half
LEAST_SHOWN = 0.4

# plane units; all projections show so much around straight ahead: a face of a cube no more than this
PLANE_EXTENT = 1.0

# radians; a step straight ahead, whose square (1e-10) is the error of taking the projection for linear there
STEP, STEP_ERROR = 1e-5, 1e-9

# of derivatives by differences: STEP squared and the rounding of a difference, 1e-16 / STEP
DERIVATIVE = 1e-8

# Near its farthest longitude panini at a large distance turns back: there u tells the longitude to the root of 1e-16
PANINI = 1e-7

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
        "mercator": (longitude, np.log(np.tan(np.pi / 4 + latitude / 2))),
        "miller": (longitude, 1.25 * np.log(np.tan(np.pi / 4 + 0.4 * latitude))),
        "compressed-rectilinear": (2 * np.tan(longitude / 2), np.tan(latitude) / np.cos(longitude)),
        "panini": (2 * np.tan(longitude / 2), 2 * np.tan(latitude) / (1 + np.cos(longitude))),
        "transverse-mercator": (
            np.arctanh(np.cos(latitude) * np.sin(longitude)),
            np.arctan2(np.tan(latitude), np.cos(longitude)),
        ),
    }
    for name, plane in expected.items():
        np.testing.assert_allclose(PROJECTIONS[name].forward(ray), [plane], rtol=0, atol=UNIT, err_msg=name)


RADII = {
    "rectilinear": np.tan,
    "stereographic": lambda theta: 2 * np.tan(theta / 2),
    "fisheye": lambda theta: theta,
    "equisolid": lambda theta: 2 * np.sin(theta / 2),
}


@pytest.mark.parametrize("name", RADII)
@pytest.mark.parametrize("theta", [0.1, 0.8, 1.5])
def test_distance_from_the_middle_goes_by_the_angle_from_straight_ahead(name, theta):
    turn = np.linspace(0, 2 * np.pi, 13)
    towards = np.column_stack([np.cos(turn), np.sin(turn)])
    rays = np.column_stack([np.sin(theta) * towards, np.full(len(turn), np.cos(theta))])

    np.testing.assert_allclose(PROJECTIONS[name].forward(rays), RADII[name](theta) * towards, rtol=0, atol=10 * UNIT)


def stretch(projection, rays):
    """Derivatives (n, 2, 2) of the plane by steps to the right and down along the unit sphere."""
    right = np.column_stack([rays[:, 2], np.zeros(len(rays)), -rays[:, 0]])
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    sides = (right, np.cross(rays, right))
    steps = [(projection.forward(rays + h) - projection.forward(rays - h)) / (2 * STEP) for h in np.array(sides) * STEP]
    return np.stack(steps, axis=2)


@pytest.fixture
def ahead(rays):
    """Those within about 66 degrees of straight ahead."""
    return rays[rays[:, 2] > 0.4]


@pytest.mark.parametrize("name", ["mercator", "stereographic", "transverse-mercator"])
def test_conformal_projections_keep_shapes(name, ahead):
    (a, b), (c, d) = np.moveaxis(stretch(PROJECTIONS[name], ahead), 0, 2)

    # a turn times a scale
    np.testing.assert_allclose(a, d, rtol=0, atol=DERIVATIVE * np.abs(a).max())
    np.testing.assert_allclose(b, -c, rtol=0, atol=DERIVATIVE * np.abs(a).max())


def test_equisolid_keeps_areas(ahead):
    np.testing.assert_allclose(np.linalg.det(stretch(PROJECTIONS["equisolid"], ahead)), 1, rtol=0, atol=DERIVATIVE)


# in a row of faces, the face behind is on the right
@pytest.mark.parametrize("name", sorted(set(PROJECTIONS) - {"cube"}))
@pytest.mark.parametrize("mirror", [[-1, 1, 1], [1, -1, 1]])
def test_left_is_the_mirror_of_right_and_up_of_down(name, rays, mirror):
    projection = PROJECTIONS[name]

    np.testing.assert_allclose(
        projection.forward(rays * mirror), projection.forward(rays) * mirror[:2], rtol=RELATIVE, atol=UNIT
    )


def test_straight_verticals(rng):
    """Points on a vertical line of the world have one u."""
    foot, height = rng.uniform(-1, 1, 50), rng.uniform(-2, 2, 50)
    rays = np.column_stack([foot, height, np.ones(50)])
    level = np.column_stack([foot, np.zeros(50), np.ones(50)])

    for name in ("rectilinear", "panini", "compressed-rectilinear", "cylindrical", "mercator", "miller"):
        u = PROJECTIONS[name].forward(rays)[:, 0]
        np.testing.assert_allclose(u, PROJECTIONS[name].forward(level)[:, 0], rtol=0, atol=UNIT, err_msg=name)


@pytest.mark.parametrize("distance", [0.0, 0.4, 1.0, 1.7, 10.0])
def test_panini_at_any_distance(rays, distance):
    panini = PROJECTIONS["panini"]
    plane = panini.forward(rays, distance)
    shown = np.isfinite(plane).all(1)
    assert shown.mean() > LEAST_SHOWN

    back = panini.inverse(plane[shown], distance)

    back /= np.linalg.norm(back, axis=1, keepdims=True)
    np.testing.assert_allclose(back, rays[shown], rtol=0, atol=PANINI)


def test_panini_without_distance_is_rectilinear(rays):
    np.testing.assert_allclose(
        PROJECTIONS["panini"].forward(rays, 0.0), PROJECTIONS["rectilinear"].forward(rays), rtol=RELATIVE
    )


def test_lines_through_the_middle_stay_straight_in_panini():
    rays = np.column_stack([np.linspace(-3, 3, 31), 0.4 * np.linspace(-3, 3, 31), np.ones(31)])
    u, v = PROJECTIONS["panini"].forward(rays).T

    np.testing.assert_allclose(v, 0.4 * u, rtol=0, atol=UNIT)


# where a projection has no answer: its name and the rays
ENDS = {
    "rectilinear": [[0, 0, -1.0], [1, 0, 0]],
    "compressed-rectilinear": [[0, 0, -1.0], [1, 0, 0]],
    "cylindrical": [[0, 1.0, 0]],
    "mercator": [[0, 1.0, 0], [0, -1, 0]],
    "stereographic": [[0, 0, -1.0]],
    "panini": [[0, 0, -1.0], [0, 1, 0]],
    "transverse-mercator": [[1.0, 0, 0], [-1, 0, 0]],
}
# the whole sphere ends at: plane coordinates beyond which there is nothing
EDGES = {
    "miller": (0.3, 2.3034125433763912),
    "fisheye": (np.pi, 0.0),
    "equisolid": (0.0, 2.0),
    "compressed-rectilinear": (2.0, 0.1),
    "transverse-mercator": (0.2, np.pi),
}


@pytest.mark.parametrize("name", ENDS)
def test_where_a_projection_has_no_answer(name):
    assert np.isnan(PROJECTIONS[name].forward(np.array(ENDS[name]))).any(1).all()


@pytest.mark.parametrize("name", EDGES)
def test_beyond_its_edge_there_is_nothing(name):
    edge = np.array(EDGES[name])
    out = edge * [edge[0] >= 1, edge[1] >= 1] * MARGIN

    assert np.isfinite(PROJECTIONS[name].inverse(edge[None] - out)).all()
    assert np.isnan(PROJECTIONS[name].inverse(edge[None] + out)).any()


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


CUBE = PROJECTIONS["cube"]
# of the faces of a cube: what is in the middle, and then right of it and below it
IN_THE_MIDDLE = {
    "left": [[-1, 0, 0], [0, 0, 1], [0, 1, 0]],
    "front": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
    "right": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "back": [[0, 0, -1], [-1, 0, 0], [0, 1, 0]],
    "up": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "down": [[0, 1, 0], [1, 0, 0], [0, 0, -1]],
}


@pytest.mark.parametrize("name", cube.FACES)
def test_each_face_of_a_cube_is_a_rectilinear_view(name, rng):
    place = np.array([2.0 * cube.FACES.index(name) - 2, 0])
    ahead, right, down = np.array(IN_THE_MIDDLE[name], float)
    uv = rng.uniform(-1, 1, (50, 2))
    rays = ahead + uv[:, :1] * right + uv[:, 1:] * down

    np.testing.assert_allclose(CUBE.forward(rays), uv + place, rtol=0, atol=UNIT)


def test_the_row_of_faces_there_and_back(rng):
    uv = np.column_stack([rng.uniform(-3, 9, COUNT), rng.uniform(-1, 1, COUNT)])

    np.testing.assert_allclose(CUBE.forward(CUBE.inverse(uv)), uv, rtol=0, atol=UNIT)


@pytest.mark.parametrize("beside", [[-3.1, 0], [9.1, 0], [0, 1.1], [5, -1.1]])
def test_beside_the_faces_there_is_nothing(beside):
    assert np.isnan(CUBE.inverse(np.array([beside]))).any()


def test_four_faces_stand_side_by_side_as_in_the_world():
    for edge in (-1.0, 1.0, 3.0):
        left, right = CUBE.inverse(np.array([[edge - UNIT, 0.4], [edge, 0.4]]))
        np.testing.assert_allclose(left, right, rtol=0, atol=10 * UNIT)


@pytest.mark.parametrize("number", range(len(cube.FACES)))
def test_one_face_goes_on_beyond_its_edges(number, rays):
    plane = CUBE.forward(rays, number)
    shown = np.isfinite(plane).all(1)
    assert shown.mean() > LEAST_SHOWN

    back = CUBE.inverse(plane[shown], number)

    back /= np.linalg.norm(back, axis=1, keepdims=True)
    np.testing.assert_allclose(back, rays[shown], rtol=0, atol=UNIT)
    assert (np.abs(plane[shown] - [2 * (number - 1), 0]) > 1).any()
