"""`--report`: with a panorama, without one, and what is refused before any work is done."""

QUICK = ["--detector", "orb", "--max-features", "600", "--retries", "none", "--seams", "voronoi", "--blender", "none"]
ENDS = "</html>"


def test_a_panorama_has_a_report(call, photos, tmp_path):
    result = call(photos, "-o", "out.jpg", "--report", "out.html", "--save-project", "out.pano.json", *QUICK)

    assert result.code == 0, result.err
    assert "out.html: what became of the photos" in result.err
    page = (tmp_path / "out.html").read_text()
    assert page.rstrip().endswith(ENDS)
    assert "--detector orb" in page

    result = call("render", "out.pano.json", "-o", "again.jpg", "--report", "again.html")
    assert result.code == 0, result.err
    page = (tmp_path / "again.html").read_text()
    assert 'id="panorama"' in page
    assert "control points" in page


def test_a_cube_has_a_report(call, photos, tmp_path):
    result = call(photos, "-o", "out.jpg", "--report", "out.html", "--projection", "cube", "--scale", "0.3", *QUICK)

    assert result.code == 0, result.err
    assert (tmp_path / "out.html").read_text().rstrip().endswith(ENDS)


def test_a_failure_has_a_report_and_names_it(call, photos, strays, tmp_path):
    given = [photos / "a.jpg", strays / "lonely.jpg", strays / "letter.jpg"]
    result = call(*given, "-o", "out.jpg", "--report", "why.html", *QUICK)

    assert result.code == 4
    assert "  report: why.html\n" in result.err
    assert not (tmp_path / "out.jpg").exists()
    page = (tmp_path / "why.html").read_text()
    assert "Failed with exit code 4" in page
    assert "Left out: lonely.jpg" in page
    assert "Left out: letter.jpg" in page
    assert ">unreadable</span>" in page


def test_photos_that_are_required_and_missing_have_a_report(call, photos, strays, tmp_path):
    given = [photos / "a.jpg", photos / "b.jpg", strays / "lonely.jpg"]
    result = call(*given, "-o", "out.jpg", "--report", "why.html", "--require-all", *QUICK)

    assert result.code == 4
    assert "Left out: lonely.jpg" in (tmp_path / "why.html").read_text()


def test_a_report_is_not_overwritten_unasked(call, photos, tmp_path):
    (tmp_path / "mine.html").write_text("mine")
    result = call(photos, "-o", "out.jpg", "--report", "mine.html")

    assert result.code == 8
    assert "mine.html: exists already" in result.err
    assert (tmp_path / "mine.html").read_text() == "mine"
    assert not (tmp_path / "out.jpg").exists()


def test_a_report_has_to_be_html(call, photos):
    result = call(photos, "-o", "out.jpg", "--report", "report.pdf")

    assert result.code == 8
    assert "the name must end in .html" in result.err


def test_without_jinja_nothing_is_done(call, photos, tmp_path, monkeypatch):
    monkeypatch.setattr("panostitch.report.write.find_spec", lambda _: None)
    result = call(photos, "-o", "out.jpg", "--report", "out.html")

    assert result.code == 9
    assert "next: pip install 'panostitch[report]'" in result.err
    assert list(tmp_path.iterdir()) == []


def test_a_dry_run_writes_no_report(call, photos):
    result = call(photos, "-o", "out.jpg", "--report", "out.html", "--dry-run")

    assert result.code == 2
    assert "--report would" in result.err
