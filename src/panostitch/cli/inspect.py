"""`panostitch inspect`: what a panorama, a photo or a project file holds."""

from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from panostitch.io.inspection import Border, Picture
    from panostitch.io.inspection.shot import Shot
    from panostitch.jobs.inspect import Project
    from panostitch.model.score import Score

Facts = list[tuple[str, str]]
NEGLIGIBLE = 5e-5  # of a picture: rounds to 0.00 %
WORST_LINKS = WORST_PLACES = 3  # named one by one


@click.command("inspect")
@click.argument("file")
@click.option(
    "--photos",
    multiple=True,
    metavar="PHOTOS",
    help="Score a picture against the photos that it was made of, by whatever program (files, folders; repeatable).",
)
@click.option("--json", "as_json", is_flag=True, help="The same as JSON.")
def command(file: str, photos: tuple[str, ...], as_json: bool) -> int:
    """Look into FILE: a panorama or another picture, a project file (.pano.json), or one of Hugin (.pto).

    Of a picture: size, depth, projection and field of view, metadata, how it lies in the file, and what of it is empty.
    Of a project: its photos, model, links, errors, what was left out and why, and the canvas that would come of it.
    Large files are looked at piece by piece.
    """
    from panostitch.cli.terminal import print_json, show_facts
    from panostitch.errors import EXIT_OK, UsageError
    from panostitch.io.inspection import inspect_picture
    from panostitch.io.project import EXTENSION as OURS
    from panostitch.io.pto import EXTENSION as HUGINS

    if file.lower().endswith((OURS, HUGINS)):
        from panostitch.jobs.inspect import inspect_project

        if photos:
            raise UsageError(
                "--photos: a project has no picture to score", hint="name the panorama that was made of it"
            )
        project = inspect_project(file)
        data, facts = project_json(project), project_facts(project)
    else:
        picture = inspect_picture(file)
        data, facts = picture_json(picture), picture_facts(picture)
        if photos:
            score = _scored(file, photos)
            data, facts = data | {"score": score.to_json()}, [*facts, *score_facts(score)]
    if as_json:
        print_json(data)
    else:
        show_facts(facts)
    return EXIT_OK


def picture_facts(picture: "Picture") -> Facts:
    """What people are told of a picture; nothing of what it does not say."""
    width, height = picture.size
    facts = [
        ("file", f"{picture.path}: {picture.format}, {_megabytes(picture.bytes)}"),
        ("size", f"{width} x {height} px ({picture.megapixels:.1f} megapixels)"),
        ("pixels", f"{picture.bits} bit{'s' * (picture.bits > 1)} a channel, {picture.channels}"),
        ("stored as", picture.storage),
        ("smaller copies", _copies(picture.levels)),
        ("projection", picture.sphere.projection if picture.sphere else ""),
        ("field of view", _field(picture)),
        ("heading", _heading(picture)),
        *_shot_facts(picture.shot),
        ("empty", _emptiness(picture.border) if picture.border else picture.note),
    ]
    return [fact for fact in facts if fact[1]]


def _scored(file: str, photos: tuple[str, ...]) -> "Score":
    from panostitch.cli.session import open_given
    from panostitch.io.readers import open_photo
    from panostitch.jobs.inspect import score_picture

    opened, _, _ = open_given(photos, require_all=True)
    return score_picture(open_photo(file), opened)


def score_facts(score: "Score") -> Facts:
    """How well the picture shows what its photos do."""
    from panostitch.model.score import MEASURES

    if score.total is None:
        return [("score", "none: the photos are not found in the picture, or nowhere two of them")]
    units = {"displacement": " px", "colour": " dE", "structure": " levels", "ghost": " levels", "blur": ""}
    measures = [(name, getattr(score, name)) for name in MEASURES]
    told = ", ".join(f"{name} {value:.2f}{units[name]}" for name, value in measures if value is not None)
    worst = ", ".join(f"{place.x:.0f}/{place.y:.0f}" for place in score.worst[:WORST_PLACES])
    return [("score", f"{score.total:.2f} (0 is perfect): {told}"), ("worst places", worst and f"{worst} px")]


def _field(picture: "Picture") -> str:
    if picture.field_of_view is None:
        return ""
    return _degrees(picture.field_of_view) + ("" if picture.sphere else ", by its focal length")


def _heading(picture: "Picture") -> str:
    heading = picture.sphere.heading if picture.sphere else None
    return "" if heading is None else f"{heading:g} degrees from north"


def _shot_facts(shot: "Shot") -> Facts:
    place = shot.position
    turned = f"to be turned by EXIF ({shot.orientation}); sides are those of the stored pixels"
    return [
        ("orientation", turned if shot.orientation != 1 else ""),
        ("camera and lens", shot.lens),
        ("exposure", shot.exposure),
        ("taken", shot.taken),
        ("place", f"{place.latitude:.5f}, {place.longitude:.5f}" if place else ""),
        ("colour profile", shot.profile),
        ("software", shot.software),
    ]


def _copies(levels: tuple[tuple[int, int], ...]) -> str:
    return f"{len(levels)}, down to {levels[-1][0]} x {levels[-1][1]} px" if levels else ""


def _emptiness(border: "Border") -> str:
    sides = (border.left, border.top, border.right, border.bottom)
    exact = f", exact to {border.step} px" if border.step > 1 else ""
    if border.share < NEGLIGIBLE and not any(sides):
        return f"nothing {border.kind}{' at the edges' if border.kind == 'black' else ''}{exact}"
    told = ", ".join(f"{name} {px}" for name, px in zip(("left", "top", "right", "bottom"), sides, strict=True))
    return f"{100 * border.share:.2f} % {border.kind}; all along the sides: {told} px{exact}"


def picture_json(picture: "Picture") -> dict[str, Any]:
    """The same for programs."""
    import dataclasses

    return {"kind": "picture"} | dataclasses.asdict(picture) | {"megapixels": picture.megapixels}


def project_facts(project: "Project") -> Facts:
    """What people are told of a project."""
    alignment = project.alignment
    names = [photo.name for photo in alignment.photos]
    held = "" if alignment.held_back_rms is None else f", {alignment.held_back_rms:.2f} px where held back"
    worst = sorted(alignment.links, key=lambda link: -link.rms)[:WORST_LINKS]
    facts = [
        ("file", f"{project.path}: {project.format}, {_megabytes(project.bytes)}"),
        ("photos", f"{len(names)}: {', '.join(names)}"),
        ("model", f"{alignment.model}: {alignment.reason}"),
        ("error", f"{alignment.rms:.2f} px rms, 95 % below {alignment.p95:.2f} px{held}"),
        ("links", f"{len(alignment.links)}, with {sum(link.matches for link in alignment.links)} control points"),
        *(("", f"{names[k.i]} - {names[k.j]}: {k.matches} matches, {k.rms:.2f} px rms") for k in worst),
        ("dropped links", f"{len(alignment.dropped)}" if alignment.dropped else ""),
        ("meshes", "photos are bent against parallax" if alignment.local_warp and alignment.local_warp.used else ""),
        *(("left out", f"{photo.name}: {'; '.join((photo.reason, *photo.details))}") for photo in alignment.left_out),
        ("projection", f"{project.projection} ({project.reason})" if project.canvas else f"none: {project.reason}"),
        ("field of view", _degrees(project.field_of_view) if project.field_of_view else ""),
        ("canvas", _canvas(project.canvas) if project.canvas else ""),
        *(("missing", wrong) for wrong in project.missing),
    ]
    return [fact for fact in facts if fact[1]]


def _canvas(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]} px ({size[0] * size[1] / 1e6:.1f} megapixels) before the crop"


def project_json(project: "Project") -> dict[str, Any]:
    """The same for programs."""
    alignment = project.alignment.to_json()
    whole = ("model", "reason", "rms", "p95", "held_back_rms", "held_back_p95", "links", "dropped", "left_out")
    return {
        "kind": "project",
        "path": project.path,
        "format": project.format,
        "bytes": project.bytes,
        "photos": [{name: photo[name] for name in ("name", "path", "size", "focal")} for photo in alignment["photos"]],
        **{name: alignment[name] for name in whole},
        "local_warp": alignment["local_warp"],
        "projection": project.projection or None,
        "projection_reason": project.reason,
        "field_of_view": project.field_of_view,
        "canvas": project.canvas,
        "missing": project.missing,
    }


def _degrees(field: tuple[float, float]) -> str:
    return f"{field[0]:.1f} x {field[1]:.1f} degrees"


def _megabytes(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count} bytes"
