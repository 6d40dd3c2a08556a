"""The figures of the acceptance sheet, from one or several runs of the script; docs/check.md says what each means."""

from collections.abc import Iterator

import numpy as np

from kpopnet.dance.dimensions.stage import runs
from kpopnet.datasets.check_script import END_S, step_s
from kpopnet.evaluation.acceptance.watched import Watched
from kpopnet.evaluation.poses.metrics import joint_errors_m, mean_error_m
from kpopnet.skeleton import MIRROR, Joint

CORE = (Joint.HEAD, Joint.NECK, Joint.TORSO, Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP)
ENDS = (Joint.RIGHT_HAND, Joint.LEFT_HAND, Joint.RIGHT_FOOT, Joint.LEFT_FOOT)
ARMS = tuple(joint for joint in Joint if joint.name.endswith(("SHOULDER", "ELBOW", "HAND")))
LEGS = tuple(joint for joint in Joint if joint.name.endswith(("HIP", "KNEE", "FOOT")))

STALE_S = 0.15
AWAY_S = 1.0
"""A person who was out of view for so long has left."""

CENTRE_M = 0.3
"""Where the truth is known, joints whose mean is farther than this from the person's are those of something else."""

REST_MARGIN_S = (2.0, 0.5)
"""Jitter is measured this long after the start of standing still, until this long before its end."""

EXCHANGED, EXCHANGED_M = 0.5, 0.1
"""Sides are exchanged where the joints are nearer to those of the other side: by at least this ratio and distance."""

MEMORY_S = 0.5
"""Joints are compared with those of images at most so much earlier."""


def figures(runs: list[Watched]) -> dict[str, float | int | None]:
    """Every figure of the sheet by name; lengths in mm, times in ms, shares in 0..1; None where it was not measured.

    Runs are put together: images, delays, errors and jitter are pooled, exchanges and false people counted, and the longest gap
    and the latest return are those of the worst run.
    """
    delays_ms = 1000 * np.concatenate([run.delays_s for run in runs])
    live = bool(np.isfinite(delays_ms).all())
    span_s = sum(run.times_s[-1] - run.times_s[0] for run in runs)
    weights, found = zip(*[(durations_s(run) * run.in_view, present(run)) for run in runs], strict=True)
    shown_s, with_joints_s = sum(map(np.sum, weights)), sum((w * f).sum() for w, f in zip(weights, found, strict=True))
    returns, gaps = [until_found_s(run) for run in runs], [longest_gap_s(run) for run in runs]
    errors_m = [
        joint_errors_m(run.truth_m, run.joints_m)[run.in_view & present(run)] for run in runs if run.truth_m is not None
    ]
    errors = np.concatenate(errors_m) if errors_m else np.zeros((0, len(Joint)))
    p50, p95, p99 = np.percentile(delays_ms, (50, 95, 99)).tolist() if live else (None,) * 3
    return {
        "images_in_s": float(sum(run.received - 1 for run in runs) / span_s) if live else None,
        "images_out_s": float(sum(len(run.times_s) - 1 for run in runs) / span_s) if live else None,
        "delay_p50_ms": p50,
        "delay_p95_ms": p95,
        "delay_p99_ms": p99,
        "delay_longest_ms": float(delays_ms.max()) if live else None,
        "processor_p95_ms": 1000 * float(np.percentile(np.concatenate([run.processor_s for run in runs]), 95)),
        "stale_images": int((delays_ms > 1000 * STALE_S).sum()) if live else None,
        "false_people": sum(len(false_people(run)) for run in runs),
        "empty_s": float(sum(durations_s(run)[run.empty].sum() for run in runs)),
        "availability": float(with_joints_s / shown_s) if shown_s else None,
        "found_first_ms": _worst_ms([first for first, _ in returns]),
        "found_again_ms": _worst_ms([again for _, again in returns]),
        "longest_gap_ms": _worst_ms(gaps) if with_joints_s else None,
        "exchanges": sum(len(exchanges(run)) for run in runs) if with_joints_s else None,
        "jitter_core_mm": _rms_mm([jitter_m(run, CORE) for run in runs]),
        "jitter_ends_mm": _rms_mm([jitter_m(run, ENDS) for run in runs]),
        "mean_error_mm": _mm(mean_error_m(errors)),
        "ends_error_mm": _mm(mean_error_m(errors[:, ENDS])),
    }


def script_fault(run: Watched) -> str:
    """Why the figures of a run say little, "" for a run of the script."""
    room, still = (
        (run.times_s >= start_s) & (run.times_s < end_s) for start_s, end_s in map(step_s, ("empty room", "stand still"))
    )
    if not (run.in_view | run.empty).any():
        return "no image has a measured pixel; is the lens covered?"
    if run.truth_m is None and 2 * sum(bool(run.people_m[number]) for number in np.flatnonzero(room)) > room.sum():
        return "a person was found in most images of the empty room, with which it begins: the script was not followed"
    return "" if run.in_view[still].any() else "no person was in view while one should stand still: the script was not followed"


def durations_s(run: Watched) -> np.ndarray:
    """(T,) how long each image is the newest one; the last one as long as an image in the median."""
    steps = np.diff(run.times_s)
    return np.append(steps, np.median(steps))


def present(run: Watched) -> np.ndarray:
    """(T,) bool: whether the core joints of the person are there; those of something else do not count where that is known."""
    found = np.asarray(np.isfinite(run.joints_m[:, CORE]).all(axis=(1, 2)))
    if run.truth_m is not None:
        centres_m = np.nanmean(np.where(found[:, None, None], run.joints_m, 0), axis=1)
        return found & (np.linalg.norm(centres_m - run.truth_m.mean(axis=1), axis=-1) <= CENTRE_M)
    return found


def visits(run: Watched) -> list[tuple[int, int]]:
    """The stretches in which a person is in view, with what is shorter than AWAY_S between them filled."""
    joined: list[tuple[int, int]] = []
    for stretch in runs(run.in_view):
        first = stretch.start
        if joined and run.times_s[first] - run.times_s[joined[-1][1] - 1] < AWAY_S:
            first = joined.pop()[0]
        joined.append((first, stretch.stop))
    return joined


def until_found_s(run: Watched) -> tuple[float, float]:
    """Seconds from coming into view until the joints are there, for the first visit and the last one; infinite for never, NaN
    where there is no such visit.
    """
    found, waited = present(run), []
    for first, last in visits(run):
        seen = np.flatnonzero(found[first:last])
        waited.append(float(run.times_s[first + seen[0]] - run.times_s[first]) if len(seen) else np.inf)
    return waited[0] if waited else np.nan, waited[-1] if len(waited) > 1 else np.nan


def gaps(run: Watched) -> Iterator[tuple[int, int]]:
    """The stretches without joints of a person in view who was found before."""
    found = present(run)
    for first, last in visits(run):
        seen = np.flatnonzero(found[first:last])
        if len(seen):
            begin = first + int(seen[0])
            missing = run.in_view[begin:last] & ~found[begin:last]
            yield from ((begin + one.start, begin + one.stop) for one in runs(missing))


def longest_gap_s(run: Watched) -> float:
    lengths = durations_s(run)
    return max((float(lengths[first:last].sum()) for first, last in gaps(run)), default=0.0)


def false_people(run: Watched) -> list[int]:
    """The image in which each appearance of a person in the empty room begins."""
    return [one.start for one in runs(run.empty & np.array([bool(people) for people in run.people_m]))]


def exchanges(run: Watched) -> list[int]:
    """The images in which the sides of arms or legs are exchanged, or exchanged back.

    Where the truth is known: whether each image's left and right are those of the person. Else: from one image to the next.
    """
    changed: set[int] = set()
    found = np.flatnonzero(run.in_view & present(run))
    for group in (ARMS, LEGS):
        is_exchanged = False
        for before, now in zip([-1, *found.tolist()], found.tolist(), strict=False):
            if run.truth_m is not None:
                reference_m = run.truth_m[now]
            elif before >= 0 and run.times_s[now] - run.times_s[before] <= MEMORY_S:
                reference_m = run.joints_m[before]
            else:
                continue
            own, other = _apart_m(run.joints_m[now], reference_m, group)
            was_exchanged = is_exchanged and run.truth_m is not None
            if _clearly(own, other) if was_exchanged else _clearly(other, own):
                changed.add(now)
                is_exchanged = not was_exchanged
    return sorted(changed)


def _apart_m(joints_m: np.ndarray, reference_m: np.ndarray, group: tuple[Joint, ...]) -> tuple[float, float]:
    """Mean distance of (15, 3) joints of a group from the reference's, and from those of its other side."""
    columns = np.array(group)
    own = np.linalg.norm(joints_m[columns] - reference_m[columns], axis=-1)
    other = np.linalg.norm(joints_m[columns] - reference_m[MIRROR[columns]], axis=-1)
    known = np.isfinite(own) & np.isfinite(other)
    return (float(own[known].mean()), float(other[known].mean())) if known.any() else (np.nan, np.nan)


def _clearly(less: float, more: float) -> bool:
    return less < EXCHANGED * more and more - less > EXCHANGED_M


def jitter_m(run: Watched, joints: tuple[Joint, ...]) -> np.ndarray:
    """(N,) distances of joints from their mean places while the person stands still."""
    start_s, end_s = step_s("stand still")
    still = (run.times_s >= start_s + REST_MARGIN_S[0]) & (run.times_s < min(end_s, END_S) - REST_MARGIN_S[1])
    rest_m = run.joints_m[still & present(run)][:, joints].astype(np.float64)
    rest_m = rest_m[np.isfinite(rest_m).all(axis=(1, 2))]
    return np.linalg.norm(rest_m - rest_m.mean(axis=0), axis=-1).ravel() if len(rest_m) else np.zeros(0)


def _rms_mm(parts: list[np.ndarray]) -> float | None:
    apart_m = np.concatenate(parts)
    return _mm(float(np.sqrt((apart_m**2).mean()))) if len(apart_m) else None


def _mm(metres: float) -> float | None:
    return 1000 * metres if np.isfinite(metres) else None


def _worst_ms(seconds: list[float]) -> float | None:
    """The longest of several times, infinite where one is; None where one is not known."""
    return 1000 * max(seconds) if seconds and not np.isnan(seconds).any() else None
