"""What writing a panorama will take, before it is begun."""

import io
import time
from dataclasses import dataclass, replace

from panostitch.io.limits import arranged, channels_in, check_sides, depth_for, need
from panostitch.io.rendering import Rendering, tiles_of
from panostitch.io.writers import encode_panorama
from panostitch.model.canvas import Region
from panostitch.model.panorama import Panorama, keep
from panostitch.options import OutputOptions
from panostitch.runtime import machine
from panostitch.runtime.executor import Executor
from panostitch.runtime.memory import SLACK, resident

SAMPLES = 5  # tiles, spread over the picture, that are made to see how long they take


@dataclass(frozen=True)
class Forecast:
    """What a panorama will take: bytes of memory at most, on so many threads."""

    memory: int
    threads: int


def forecast(panorama: Panorama, path: str, options: OutputOptions, *, run: Executor) -> Forecast:
    """Memory for a panorama. Raises LimitError where its format is too small, or --max-memory."""
    check_sides(path, panorama.plan.crop)
    depth, _ = depth_for(panorama, path, options.depth)
    picture = arranged(Rendering(panorama, run, channels_in(panorama, path), depth), path, options)
    threads = min(picture.run.threads, len(tiles_of(panorama.plan.crop)))
    needed = need(picture, path)
    return Forecast(int((resident() + needed.besides + threads * needed.each) * SLACK), threads)


def expected_seconds(panorama: Panorama, path: str, options: OutputOptions, *, threads: int) -> float:
    """Time for rendering and writing a panorama, measured on a few of its tiles.

    Each is made twice: what the first time takes longer is the decoding of the photos that it shows.
    """
    plan = panorama.plan
    tiles = tiles_of(plan.crop)
    chosen = (
        [tiles[len(tiles) * (2 * n + 1) // (2 * SAMPLES)] for n in range(SAMPLES)] if len(tiles) > SAMPLES else tiles
    )
    first, again = (sum(_seconds(panorama, path, options, tile) for tile in chosen) for _ in range(2))
    photos, shown = (len(frozenset().union(*map(panorama.photos, some))) for some in (tiles, chosen))
    decoding = max(first - again, 0.0) * photos / max(shown, 1)
    share = plan.crop.area / sum(tile.area for tile in chosen)
    return (again * share + decoding) / max(1, min(threads, machine.threads()))


def _seconds(panorama: Panorama, path: str, options: OutputOptions, tile: Region) -> float:
    """What it takes to make a tile and to encode it as a picture of its own."""
    depth, _ = depth_for(panorama, path, options.depth)
    tile_alone = replace(panorama, plan=replace(panorama.plan, crop=tile), forget=keep)
    picture = Rendering(tile_alone, Executor(), channels_in(panorama, path), depth)
    began = time.perf_counter()
    encode_panorama(io.BytesIO(), path, picture, replace(options, pyramid="none"))
    return time.perf_counter() - began
