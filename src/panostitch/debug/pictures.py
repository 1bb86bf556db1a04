"""Which pictures each event of the stages becomes."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from panostitch.debug import diagram, draw, folder
from panostitch.debug.draw import BADLY, WELL
from panostitch.debug.filenames import FileNames
from panostitch.debug.ink import GREEN, LONGEST, VERMILLION, Picture, captioned, fit, resized, to_bytes
from panostitch.debug.pairs import PairPictures
from panostitch.geometry.sampling import rescale
from panostitch.model.alignment import Alignment
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.features import Features
from panostitch.model.finding import Finding
from panostitch.model.light import Light
from panostitch.model.match import Groups, Link, PutativeMatch, VerifiedMatch
from panostitch.model.mesh import Mesh
from panostitch.model.photo import Photo
from panostitch.model.score import Places, SeamScore

Pixels = NDArray[np.float32]
Save = Callable[[str, Callable[[], Picture]], None]

HALF = (LONGEST - draw.GAP) // 2  # px, a photo of a pair: the size that is kept in memory
KEPT_PHOTOS = 24  # at 2 MB each
MOST_NAMED = 12  # seams under their picture
MOST_ENLARGED = 2.0  # small photos are drawn larger, so that circles can be told apart


class PhotoPixels:
    """Photos at the sizes they are drawn in; the small ones are kept, those used last."""

    def __init__(self) -> None:
        self._kept: OrderedDict[str, Picture] = OrderedDict()

    def large(self, photo: Photo) -> Picture:
        """The photo with its longest side at LONGEST, or MOST_ENLARGED times its own size if that is less."""
        picture = _read(photo, LONGEST)
        self._keep(photo, picture)
        return picture

    def half(self, photo: Photo) -> Picture:
        """The photo with its longest side at HALF."""
        if photo.name not in self._kept:
            self._keep(photo, _read(photo, HALF))
        self._kept.move_to_end(photo.name)
        return self._kept[photo.name]

    def _keep(self, photo: Photo, picture: Picture) -> None:
        self._kept[photo.name] = to_bytes(fit(picture, HALF))
        while len(self._kept) > KEPT_PHOTOS:
            self._kept.popitem(last=False)


def _read(photo: Photo, longest: int) -> Picture:
    factor = min(MOST_ENLARGED, longest / max(photo.size))
    pixels, mask = photo.source.read(min(1.0, factor))
    if mask is not None:
        # colours under transparent pixels are anybody's guess
        pixels = np.where(mask[..., None] > 0, pixels, np.uint8(128))
    width, height = (round(n * factor) for n in photo.size)
    return to_bytes(resized(pixels, width, height))


class Pictures:
    """Makes pictures: a method for each event, named like it. `save(path, draw)` draws and stores one."""

    def __init__(self, save: Save, remove: Callable[[str], None]) -> None:
        self._save = save
        self._names = FileNames()
        self._pixels = PhotoPixels()
        self._panorama: Picture | None = None
        self._pairs = PairPictures(save, remove, self._names, self._pixels.half)

    @property
    def not_drawn(self) -> list[tuple[str, str]]:
        """Names of the pairs that were matched but have no pictures."""
        return self._pairs.not_drawn

    def finish(self) -> None:
        """Draw what waits for an event that did not come."""
        self._pairs.draw()

    def photos_read(self, photos: Sequence[Photo], **_: Any) -> None:
        """File names are given in the order of the photos, whatever comes first later."""
        for photo in photos:
            self._names.of(photo.name)

    def features_detected(self, photo: Photo, features: Features, **_: Any) -> None:
        """The photo with its key points."""

        def picture() -> Picture:
            pixels = self._pixels.large(photo)
            factor = np.array(pixels.shape[1::-1]) / photo.size
            drawn = draw.features(
                pixels,
                rescale(features.xy, factor),
                np.asarray(features.scale, np.float64) * factor.mean(),
                np.asarray(features.angle, np.float64),
                np.asarray(features.response, np.float64),
            )
            circles = f", the strongest {draw.MOST_CIRCLES} as circles" if len(features) > draw.MOST_CIRCLES else ""
            size = f"{photo.size[0]} x {photo.size[1]} px"
            return captioned(drawn, f"{photo.name}   {size}   {len(features)} key points{circles}")

        self._save(f"{folder.FEATURES}/{self._names.of(photo.name)}.jpg", picture)

    def matching_linked(
        self, photos: Sequence[Photo], features: Sequence[Features], match: PutativeMatch, link: Link, **_: Any
    ) -> None:
        """A pair waits until it is known which pairs are worth a picture."""
        self._pairs.hold(photos, features, match, link)

    def matching_grouped(self, photos: Sequence[Photo], links: Sequence[Link], groups: Groups, **_: Any) -> None:
        """The pairs, and the graph of all links."""
        for link in links:
            self._pairs.decide(link)
        self._pairs.draw()
        group_of = {k: number for number, members in enumerate(groups.panoramas) for k in members}
        edges = [
            diagram.Edge(link.i, link.j, link.inliers, sound=bool(link))
            for link in self._pairs.links.values()
            if isinstance(link, VerifiedMatch) or (link.inliers and link.needed <= 2 * link.inliers)
        ]
        self._save(
            f"{folder.LINKS}/graph.png",
            lambda: diagram.graph(
                [photo.name for photo in photos],
                [self._pixels.half(photo) for photo in photos],
                [group_of.get(k) for k in range(len(photos))],
                edges,
            ),
        )

    def diagnosis_explained(
        self,
        photos: Sequence[Photo],
        features: Sequence[Features],
        matches: NDArray[np.int32],
        agree: NDArray[np.bool_],
        finding: Finding,
        **_: Any,
    ) -> None:
        """Two photos that are not linked, or weakly: their key points, and the matches that agree and that do not."""

        def picture() -> Picture:
            pixels = [self._pixels.half(photo) for photo in photos]
            ends = [
                rescale(one.xy.astype(np.float64), np.array(p.shape[1::-1]) / photo.size)
                for photo, one, p in zip(photos, features, pixels, strict=True)
            ]
            groups = [
                draw.Lines(ends[0][chosen[:, 0]], ends[1][chosen[:, 1]], ink)
                for chosen, ink in ((matches[~agree], VERMILLION), (matches[agree], GREEN))
            ]
            dotted = [draw.dots(p, xy) for p, xy in zip(pixels, ends, strict=True)]
            numbers = f"{agree.sum()} of {len(matches)} matches agree (green)"
            return captioned(
                draw.matches(dotted[0], dotted[1], groups),
                f"{photos[0].name} -- {photos[1].name}   {'weak link: ' if finding.weak else ''}{finding.cause}",
                f"{finding.evidence}; {numbers}",
            )

        pair = "--".join(self._names.of(photo.name) for photo in photos)
        self._save(f"{folder.LINKS}/why_{pair}.jpg", picture)

    def alignment_bent(self, alignment: Alignment, **_: Any) -> None:
        """Each photo that is bent, with its mesh."""
        for photo, camera in zip(alignment.photos, alignment.cameras, strict=True):
            if camera.mesh:
                self._save(
                    f"{folder.ALIGNMENT}/mesh_{self._names.of(photo.name)}.jpg", partial(self._mesh, photo, camera.mesh)
                )

    def _mesh(self, photo: Photo, mesh: Mesh) -> Picture:
        drawn, times = draw.mesh(self._pixels.half(photo), mesh)
        return captioned(drawn, f"{photo.name}   bent by up to {mesh.largest:.1f} px, drawn {times:.0f} times as much")

    def layout_chosen(self, alignment: Alignment, canvas: Canvas, reason: str, **_: Any) -> None:
        """Outlines of the photos on the canvas."""

        def picture() -> Picture:
            drawn = diagram.layout(
                [diagram.outline_on(camera, canvas) for camera in alignment.cameras],
                [photo.name for photo in alignment.photos],
                canvas.size,
                period=diagram.turn_width(canvas),
            )
            size = f"{canvas.projection}, {canvas.size[0]} x {canvas.size[1]} px"
            return captioned(drawn, f"{size}: {reason}", f"model {alignment.model}: {alignment.reason}")

        self._save(f"{folder.ALIGNMENT}/layout.png", picture)

    def compositing_warped(self, photo: Photo, layers: Sequence[Layer], canvas: Canvas, **_: Any) -> None:
        """The photo where it lies on the canvas."""
        name = self._names.of(photo.name)
        self._save(f"{folder.WARPED}/{name}.jpg", lambda: draw.on_canvas(layers, canvas.size))

    def compositing_exposed(
        self, photos: Sequence[Photo], light: Light, before: Pixels, after: Pixels, **_: Any
    ) -> None:
        """The panorama without and with gains, and the gains."""
        self._save(f"{folder.EXPOSURE}/before.jpg", lambda: to_bytes(fit(before)))
        self._save(f"{folder.EXPOSURE}/after.jpg", lambda: to_bytes(fit(after)))
        names = [photo.name for photo in photos]
        self._save(f"{folder.EXPOSURE}/gains.png", lambda: diagram.gains(names, light.brightness))

    def compositing_seamed(self, labels: NDArray[np.int16], picture: Pixels, names: Sequence[str], **_: Any) -> None:
        """Lines where one photo ends and the next begins, and who owns what."""
        self._save(f"{folder.SEAMS}/seams.jpg", lambda: draw.seams(labels, picture))
        self._save(f"{folder.SEAMS}/labels.png", lambda: draw.label_map(labels, names))

    def compositing_band(self, level: int, levels: int, pixels: Pixels, lowpass: bool, **_: Any) -> None:
        """One band of the blend."""

        def strengthened() -> Picture:
            drawn, gain = draw.band(pixels)
            return captioned(drawn, f"band {level} of {levels}, strengthened {gain:.3g} times")

        if lowpass:
            self._save(f"{folder.BLEND}/lowpass.jpg", lambda: draw.enlarged(to_bytes(fit(pixels))))
        else:
            self._save(f"{folder.BLEND}/band_{level}.jpg", strengthened)

    def compositing_cropped(
        self, picture: Pixels, coverage: NDArray[np.bool_], crop: Region, reason: str, **_: Any
    ) -> None:
        """What is cut off, and why."""
        self._save(f"{folder.CROP}/crop.jpg", lambda: captioned(draw.crop(picture, coverage, crop), reason))

    def scoring_judged(self, seams: Sequence[SeamScore], places: Places, crop: Region, **_: Any) -> None:
        """Where along the seams something is wrong."""
        if self._panorama is None:
            return
        background = self._panorama

        def picture() -> Picture:
            drawn = draw.faults(background, places, crop)
            named = [f"{seam.first} - {seam.second} {seam.score.total:.2f}" for seam in seams if seam.score.total]
            worst = f"from {WELL:g} (blue) to {BADLY:g} times (yellow) what can just be seen"
            return captioned(drawn, f"faults at the seams, {worst}", *named[:MOST_NAMED])

        self._save(f"{folder.SEAMS}/faults.jpg", picture)

    def panorama_written(self, preview: Picture, **_: Any) -> None:
        """The panorama, small."""
        self._panorama = preview
        self._save(f"{folder.PANORAMA}/panorama.jpg", lambda: to_bytes(fit(preview)))
