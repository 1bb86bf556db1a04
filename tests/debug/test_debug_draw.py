"""The drawing functions put their ink where the numbers say."""

import numpy as np
import pytest

from panostitch.debug import diagram, draw, ink
from panostitch.geometry import rotation
from panostitch.model.camera import Camera
from panostitch.model.canvas import Canvas, Layer, Region

INK_REACH = 5  # px, half a line with its rim
BLANK = np.full((120, 160, 3), 100, np.uint8)


def changed(picture, before):
    """Where a picture differs from what it was drawn on, as (x, y) px."""
    rows, columns = np.nonzero((picture != before).any(axis=-1))
    return np.column_stack([columns, rows])


def key_points(xy, scale):
    n = len(xy)
    return np.array(xy, float), np.full(n, float(scale)), np.zeros(n), np.ones(n)


def test_a_key_point_is_a_circle_of_its_scale_with_its_direction():
    dimmed = draw.features(BLANK, *key_points(np.zeros((0, 2)), 1))
    picture = draw.features(BLANK, *key_points([(60, 40)], 12))
    spots = changed(picture, dimmed)
    radius = np.hypot(*(spots - (60, 40)).T)
    assert 12 <= radius.max() <= 12 + INK_REACH
    assert picture.shape == BLANK.shape
    assert (picture[40, 66] != dimmed[40, 66]).any(), "the direction, 0, is to the right"
    assert (picture[40, 54] == dimmed[40, 54]).all()
    assert (picture[46, 60] == dimmed[46, 60]).all()


def test_of_many_key_points_the_weak_ones_are_dots():
    rng = np.random.default_rng(0)
    xy = np.vstack([rng.uniform((90, 0), (159, 119), (draw.MOST_CIRCLES, 2)), [(30, 60)]])
    response = np.append(np.ones(draw.MOST_CIRCLES), 0.5)
    before = draw.features(BLANK, *key_points(np.zeros((0, 2)), 1))
    spots = changed(draw.features(BLANK, xy, np.full(len(xy), 20.0), np.zeros(len(xy)), response), before)
    weak = spots[spots[:, 0] < 60]
    assert 0 < np.abs(weak - (30, 60)).max() <= 4


def test_match_lines_end_at_the_points():
    left, right = BLANK, np.full((100, 140, 3), 60, np.uint8)
    start, end = np.array([[20.0, 30.0]]), np.array([[100.0, 80.0]])
    before = draw.matches(left, right, [])
    assert before.shape == (120, 160 + draw.GAP + 140, 3)
    spots = changed(draw.matches(left, right, [draw.Lines(start, end)]), before)
    target = end[0] + (160 + draw.GAP, 0)
    assert np.abs(spots.min(axis=0) - (20, 30)).max() <= INK_REACH
    assert np.abs(spots.max(axis=0) - target).max() <= INK_REACH
    # and it is straight: no ink far from the segment
    direction = (target - start[0]) / np.hypot(*(target - start[0]))
    off = np.abs((spots - start[0]) @ (-direction[1], direction[0]))
    assert off.max() <= INK_REACH


def test_a_match_that_is_no_number_is_not_drawn():
    before = draw.matches(BLANK, BLANK, [])
    lines = draw.Lines(np.array([[np.nan, 3.0]]), np.array([[5.0, 5.0]]))
    assert (draw.matches(BLANK, BLANK, [lines]) == before).all()
    assert (draw.matches(BLANK, BLANK, [], overlap=np.full((4, 2), np.inf)) == before).all()


def test_the_overlap_stays_in_the_right_photo():
    before = draw.matches(BLANK, BLANK, [])
    outline = np.array([(-50.0, 20), (60, 20), (60, 90), (-50, 90)])
    spots = changed(draw.matches(BLANK, BLANK, [], overlap=outline), before)
    assert spots[:, 0].min() >= 160 + draw.GAP
    assert abs(spots[:, 0].max() - (160 + draw.GAP + 60)) <= INK_REACH


def test_a_seam_lies_on_the_boundary_of_labels():
    labels = np.zeros((120, 160), np.int16)
    labels[:, 70:] = 1
    labels[:20] = -1
    spots = changed(draw.seams(labels, BLANK), BLANK)
    assert set(spots[:, 0]) == {68, 69, 70, 71}, "two px of seam, one of rim on either side"
    assert spots[:, 1].min() in (19, 20), "no seam beside what nobody covers"
    assert spots[:, 1].max() == 119


def test_a_seam_stays_in_place_when_the_picture_is_reduced():
    labels = np.zeros((1000, 3200), np.int16)
    labels[:, 2000:] = 1
    picture = np.full((1000, 3200, 3), 100, np.float32)
    drawn = draw.seams(labels, picture)
    assert drawn.shape == (500, 1600, 3)
    columns = changed(drawn, np.full_like(drawn, 100))[:, 0]
    assert columns.min() in (998, 999)
    assert columns.max() in (1000, 1001)


def test_a_reduced_seam_has_no_labels_in_between():
    labels = np.zeros((40, 3200), np.int16)
    labels[:, 2001:] = 5
    drawn = draw.seams(labels, np.full((40, 3200, 3), 100, np.float32))
    assert len(set(changed(drawn, np.full_like(drawn, 100))[:, 0])) == 4


def test_labels_have_their_colours_and_nobody_is_dark():
    labels = np.full((200, 400), -1, np.int16)
    labels[50:, :200], labels[50:, 200:] = 0, 3
    picture = draw.label_map(labels, ["a", "b", "c", "d"])
    assert tuple(picture[190, 10]) == ink.colour(0)
    assert tuple(picture[190, 390]) == ink.colour(3)
    assert picture[:40].max() < 40
    middle = picture[115:135, 290:310].reshape(-1, 3)
    assert (middle != ink.colour(3)).any(), "the name stands in the middle of its area"


def test_labels_beyond_the_names_and_nobody_at_all_are_drawn():
    assert draw.label_map(np.full((9, 9), 7, np.int16), ["a"]).shape == (9, 9, 3)
    assert draw.label_map(np.full((9, 9), -1, np.int16), []).max() < 40


@pytest.mark.parametrize("strength", [0.01, 5.0, 1000.0])
def test_a_band_is_strengthened_until_it_can_be_seen(strength):
    band = np.zeros((100, 1000, 3), np.float32)
    band[:, 500:], band[:, :100] = strength, -strength
    picture, gain = draw.band(band)
    assert gain == pytest.approx(draw.BAND_PEAK / strength)
    assert (picture[50, 300] == 128).all()
    assert (picture[50, 900] == 238).all()
    assert (picture[50, 50] == 18).all()


def test_an_empty_band_is_grey():
    picture, gain = draw.band(np.full((10, 10, 3), np.nan, np.float32))
    assert (picture == 128).all()
    assert gain == 1.0
    assert picture.shape[0] == draw.SMALL, "small bands are enlarged"


def test_what_is_cut_off_is_dark_and_what_is_empty_is_chequered():
    coverage = np.ones((120, 160), np.bool_)
    coverage[:, :30] = False
    picture = draw.crop(BLANK, coverage, Region(60, 40, 60, 50))
    assert (picture[60, 90] == 100).all()
    assert (picture[20, 90] == 35).all()
    assert {tuple(pixel) for pixel in picture[:, :25].reshape(-1, 3)} == {(70,) * 3, (100,) * 3}
    assert (picture[40, 90] == ink.YELLOW).any(), "the rectangle"


def test_layers_lie_in_their_places():
    pixels = np.full((20, 30, 3), 200, np.float32)
    mask = np.ones((20, 30), np.bool_)
    mask[:, :5] = False
    picture = draw.on_canvas([Layer(Region(90, 10, 30, 20), pixels, mask), Layer(Region(-9, 0, 30, 20), pixels, mask)],
                             (100, 50))  # fmt: skip
    seen = np.column_stack(np.nonzero((picture == 200).all(axis=-1))[::-1])
    right, left = seen[seen[:, 0] > 50], seen[seen[:, 0] < 50]
    assert (right.min(axis=0).tolist(), right.max(axis=0).tolist()) == ([95, 10], [99, 29])
    assert (left.min(axis=0).tolist(), left.max(axis=0).tolist()) == ([0, 0], [20, 19])


def camera(yaw, pitch=0.0, focal=500.0):
    return Camera((400, 300), focal, (199.5, 149.5), rotation.from_angles(yaw, pitch, 0.0))


def turn(projection="cylindrical", scale=200.0):
    size = (round(2 * np.pi * scale), 600)
    return Canvas(projection, scale, (-size[0] / 2, -300.0), size, wraps=True)


def test_an_outline_is_where_the_camera_looks():
    outline = diagram.outline_on(camera(0.5), turn())
    assert outline[:, 0].mean() == pytest.approx(turn().size[0] / 2 + 0.5 * 200, abs=1)
    assert np.ptp(outline[:, 0]) == pytest.approx(200 * 2 * np.arctan(200 / 500), rel=0.01)
    assert (outline[0] == outline[-1]).all()


def test_an_outline_across_the_edge_of_a_turn_does_not_jump():
    canvas = turn()
    outline = diagram.outline_on(camera(np.pi), canvas)
    assert np.abs(np.diff(outline[:, 0])).max() < 20
    picture = diagram.layout([outline], ["back"], canvas.size, period=diagram.turn_width(canvas))
    empty = diagram.layout([], [], canvas.size)
    columns = changed(picture, empty)[:, 0] / picture.shape[1]
    assert columns.min() < 0.05
    assert columns.max() > 0.95
    assert not ((columns > 0.2) & (columns < 0.8)).any(), "a line runs across the whole canvas"


def test_an_outline_round_a_pole_is_drawn_as_a_line():
    canvas = turn("equirectangular")
    outline = diagram.outline_on(camera(0.0, pitch=np.pi / 2, focal=200.0), canvas)
    assert abs(np.ptp(outline[:, 0]) - diagram.turn_width(canvas)) < 20
    empty = diagram.layout([], [], canvas.size)
    picture = diagram.layout([outline], ["up"], canvas.size, period=diagram.turn_width(canvas))
    rows = changed(picture, empty)[:, 1] / picture.shape[0]
    assert 0 < rows.max() < 0.5


def test_an_outline_partly_out_of_sight_is_drawn_where_it_is_seen():
    canvas = Canvas("rectilinear", 200.0, (-400.0, -300.0), (800, 600))
    outline = diagram.outline_on(camera(1.3), canvas)
    assert np.isnan(outline).any()
    assert np.isfinite(outline).any()
    empty = diagram.layout([], [], canvas.size)
    assert (diagram.layout([outline], ["side"], canvas.size) != empty).any()
    nothing = diagram.layout([np.full((9, 2), np.nan)], ["behind"], canvas.size)
    assert (nothing == empty).all()


def test_the_graph_shows_groups_links_and_the_lonely():
    names, groups = ["a", "b", "c", "d"], [0, 0, None, 1]
    bare = diagram.graph(names, [None] * 4, groups, [])
    linked = diagram.graph(names, [BLANK, None, None, None], groups, [diagram.Edge(0, 1, 40)])
    dashed = diagram.graph(names, [None] * 4, groups, [diagram.Edge(0, 1, 40, sound=False)])
    for used in (ink.colour(0), ink.colour(1), ink.GREY):
        assert (bare == used).all(axis=-1).any()
    blue = [(picture == ink.colour(0)).all(axis=-1).sum() for picture in (bare, linked, dashed)]
    assert blue[1] > blue[0] + 1000
    assert blue[2] <= blue[0]
    assert (dashed != bare).any()
    assert (diagram.graph([], [], [], []) == ink.PAPER).all()


@pytest.mark.parametrize("count", [1, 150])
def test_a_graph_of_any_size_fits(count):
    picture = diagram.graph([f"photo {k}" for k in range(count)], [BLANK] * count, [0] * count, [])
    assert max(picture.shape) <= ink.LONGEST


def test_bars_of_gains_point_the_right_way():
    picture = diagram.gains(["darker", "brighter"], np.array([0.8, 1.1]))
    columns = [np.nonzero((picture == ink.colour(k)).all(axis=-1))[1] for k in range(2)]
    assert columns[0].max() <= columns[1].min() + 1
    assert np.ptp(columns[0]) == pytest.approx(2 * np.ptp(columns[1]), abs=3)
    assert max(diagram.gains(["x"] * 3000, np.ones(3000)).shape) <= ink.LONGEST


def test_sixty_photos_have_sixty_colours():
    colours = np.array([ink.colour(k) for k in range(60)], float)
    distance = np.abs(colours[:, None] - colours[None]).max(axis=-1) + 999 * np.eye(60)
    assert distance.min() >= 10
    assert ink.colour(63) == ink.colour(0)


def test_text_is_ascii_and_fits():
    assert ink.plain("Zürich\n写真.jpg") == "Z?rich???.jpg"
    short = ink.shorten("a very long name of a photo.jpg", 120)
    assert ink.text_width(short) <= 120
    assert short.startswith("a v")
    assert short.endswith(".jpg")


@pytest.mark.parametrize("at", [(-500, 10), (-20, -5), (155, 118), (5000, 5000), (80, 60)])
def test_text_that_leaves_the_picture_is_cut_off(at):
    picture = BLANK.copy()
    ink.write(picture, "words", at)
    seen = -40 < at[0] < 160 and at[1] < 130
    assert (picture != BLANK).any() == seen


def test_a_caption_leaves_the_picture_as_it_is():
    picture = ink.captioned(BLANK, "one", "two")
    left = (picture.shape[1] - 160) // 2
    assert (picture[:120, left : left + 160] == BLANK).all()
    assert max(ink.captioned(np.zeros((1600, 1600, 3), np.uint8), "one").shape) <= ink.LONGEST
