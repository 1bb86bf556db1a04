"""How long bundle adjustment takes and how far off it ends, on simulated photos. Prints a Markdown table.

    python benchmarks/bundle.py            1000 photos with 100,000 matches, and a job small enough for OpenCV
    python benchmarks/bundle.py --quick    the small job only

The photos stand in rows on a sphere; their matches have noise of NOISE px. The start has a focal length WRONG_FOCAL off
and rotations turned at random by WRONG_TURN on average, as a spanning tree leaves them. Seconds are those of the
processor, of all threads together. The error is the root mean square angle between the true and the found relative
rotations of photos that overlap.

The rival is cv2.detail_BundleAdjusterRay with the same matches and the same start. It knows neither of distortion nor
of wrong matches, so the job for both has none; the large one has distortion K1, and OUTLIERS of its matches are wrong.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.bundle import Freedom, adjust
from panostitch.geometry import rotation
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints
from panostitch.synthetic.scene import rig

Floats = NDArray[np.float64]

SIZE = (1600, 1200)
NOISE = 0.5  # px, standard deviation of each coordinate in both photos
OUTLIERS = 0.02
K1 = -0.08
WRONG_FOCAL = 0.10
WRONG_TURN = 0.03  # rad
LOSS_SCALE = 2.0  # px


@dataclass(frozen=True)
class Job:
    """True cameras, what they saw, and where the adjustment starts."""

    true: list[Camera]
    points: list[ControlPoints]
    start: list[Camera]

    @property
    def matches(self) -> int:
        """Number of all pairs of points."""
        return sum(map(len, self.points))


def simulated(rows: int, per_row: int, field: float, matches: int, *, k1: float, outliers: float, seed: int = 0) -> Job:
    """A full turn in rows; `field` of view across a photo in degrees, about `matches` matches in all."""
    rng = np.random.default_rng(seed)
    yaws = np.arange(per_row) * (2 * np.pi / per_row)
    pitches = (np.arange(rows) - (rows - 1) / 2) * np.deg2rad(field) * 0.5
    angles = np.stack([np.tile(yaws, rows), np.repeat(pitches, per_row)]) + rng.normal(0, 0.01, (2, rows * per_row))
    true = rig(*angles, rng.normal(0, 0.02, rows * per_row), size=SIZE, hfov=np.deg2rad(field), k1=k1)
    pairs = overlapping(true)
    points = [common(true, i, j, max(4, matches // len(pairs)), outliers, rng) for i, j in pairs]
    start = [
        replace(
            camera,
            focal=camera.focal * (1 + WRONG_FOCAL),
            k1=0.0,
            cam_from_world=rotation.exp(rng.normal(0, WRONG_TURN / np.sqrt(3), 3)) @ camera.cam_from_world,
        )
        for camera in true
    ]
    return Job(true, [o for o in points if len(o)], start)


def overlapping(cameras: Sequence[Camera]) -> list[tuple[int, int]]:
    """Pairs whose axes are less than two thirds of the field apart."""
    axes = np.array([camera.cam_from_world[2] for camera in cameras])
    field = 2 * np.arctan(SIZE[0] / 2 / cameras[0].focal)
    near = np.argwhere(np.triu(axes @ axes.T > np.cos(field * 0.67), 1))
    return [(int(i), int(j)) for i, j in near]


def common(
    cameras: Sequence[Camera], i: int, j: int, count: int, outliers: float, rng: np.random.Generator
) -> ControlPoints:
    """Noisy matches of what both photos see, a share of outliers among them."""
    xy_i = rng.uniform(0, SIZE, (20 * count, 2))
    xy_j = cameras[j].project(cameras[i].rays(xy_i))
    inside = ((xy_j >= 0) & (xy_j <= np.array(SIZE) - 1)).all(1)
    xy_i, xy_j = (p[inside][:count] + rng.normal(0, NOISE, (min(count, inside.sum()), 2)) for p in (xy_i, xy_j))
    wrong = rng.random(len(xy_j)) < outliers
    return ControlPoints(i, j, xy_i, np.where(wrong[:, None], rng.uniform(0, SIZE, xy_j.shape), xy_j))


def error(job: Job, turns: Sequence[Floats]) -> float:
    """Root mean square, in degrees, over all pairs that overlap."""
    angles = []
    for o in job.points:
        known = job.true[o.j].cam_from_world @ job.true[o.i].cam_from_world.T
        angles.append(rotation.angle(turns[o.j] @ turns[o.i].T @ known.T))
    return float(np.rad2deg(np.sqrt(np.mean(np.square(angles)))))


def ours(job: Job) -> list[Floats]:
    """Rotations, focal length, then k1 as well: a rough start is not to be bent into a lens."""
    one = (0,) * len(job.start)
    first = adjust(job.start, job.points, Freedom(one, one), loss_scale=8 * LOSS_SCALE, tolerance=1e-3)
    last = adjust(first.cameras, job.points, Freedom(one, one, terms=1), loss_scale=LOSS_SCALE)
    return [camera.cam_from_world for camera in last.cameras]


def opencv(job: Job) -> list[Floats]:
    """The rival's rays."""
    count = len(job.start)
    features, cameras = [], []
    for camera in job.start:
        features.append(cv2.detail.ImageFeatures())
        params = cv2.detail.CameraParams()
        params.focal, params.aspect, (params.ppx, params.ppy) = camera.focal, 1.0, camera.centre
        params.R = camera.cam_from_world.T.astype(np.float32)
        cameras.append(params)
    matches = [_empty(i, j) for i in range(count) for j in range(count)]
    keypoints: list[list[cv2.KeyPoint]] = [[] for _ in job.start]
    for o in job.points:
        for pair in (o, o.swapped()):
            matches[pair.i * count + pair.j] = _matches_info(pair, keypoints)
    for n, found in enumerate(features):
        found.img_idx, found.img_size, found.keypoints = n, SIZE, keypoints[n]
    adjuster = cv2.detail_BundleAdjusterRay()
    adjuster.setConfThresh(1.0)
    done, adjusted = adjuster.apply(features, matches, cameras)
    if not done:
        raise RuntimeError("cv2.detail_BundleAdjusterRay failed")
    # it returns rotations from the camera to the world, as float32
    return [rotation.nearest(np.asarray(camera.R, np.float64).T) for camera in adjusted]


def _empty(i: int, j: int) -> cv2.detail.MatchesInfo:
    info = cv2.detail.MatchesInfo()
    info.src_img_idx, info.dst_img_idx = i, j
    return info


def _matches_info(pair: ControlPoints, keypoints: list[list[cv2.KeyPoint]]) -> cv2.detail.MatchesInfo:
    info = _empty(pair.i, pair.j)
    first, second = len(keypoints[pair.i]), len(keypoints[pair.j])
    keypoints[pair.i] += [cv2.KeyPoint(float(x), float(y), 1.0) for x, y in pair.xy_i]
    keypoints[pair.j] += [cv2.KeyPoint(float(x), float(y), 1.0) for x, y in pair.xy_j]
    info.matches = [cv2.DMatch(first + k, second + k, 0.0) for k in range(len(pair))]
    info.inliers_mask = [1] * len(pair)
    info.num_inliers, info.confidence, info.H = len(pair), 2.0, np.eye(3)
    return info


def timed(solve: Callable[[Job], list[Floats]], job: Job) -> tuple[float, float]:
    """CPU seconds, and the error in degrees."""
    begin = time.process_time()
    turns = solve(job)
    return time.process_time() - begin, error(job, turns)


def main() -> None:
    """Run the jobs and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the small job only")
    quick = parser.parse_args().quick
    cv2.setNumThreads(1)
    print("| photos | pairs | matches | by | CPU s | error, degrees |\n|---|---|---|---|---|---|")
    jobs: list[tuple[Job, list[Callable[[Job], list[Floats]]]]] = [
        (simulated(3, 12, 55, 16_000, k1=0.0, outliers=0.0), [ours, opencv])
    ]
    if not quick:
        jobs.append((simulated(20, 50, 14, 100_000, k1=K1, outliers=OUTLIERS), [ours]))
    for job, solvers in jobs:
        for solve in solvers:
            seconds, degrees = timed(solve, job)
            figures = f"{len(job.true)} | {len(job.points)} | {job.matches}"
            print(f"| {figures} | {solve.__name__} | {seconds:.2f} | {degrees:.4f} |", flush=True)


if __name__ == "__main__":
    main()
