"""What papers report on real benchmarks, to stand beside our own figures there, and never beside simulated ones."""

from typing import NamedTuple

from kpopnet.benchmarks.sequences import Benchmark, Origin


class Published(NamedTuple):
    """A figure over all joints. Attributes: method. map_10cm: 0..1. pose_error_cm: Eq. 16. None where none is published."""

    method: str
    map_10cm: float | None = None
    pose_error_cm: float | None = None


PUBLISHED = {
    "eval": (
        Published("Kim & Kim 2018, tracker", map_10cm=0.9358),
        Published("Kim & Kim 2018, CNN, depth", map_10cm=0.9566),
        Published("Kim & Kim 2018, CNN, depth + ridge", map_10cm=0.9667),
    ),
    "smmc10": (
        Published("Kim & Kim 2018, tracker", pose_error_cm=3.88),
        Published("Kim & Kim 2015", map_10cm=0.9671),
    ),
}
"""By the benchmark's name. Kim & Kim 2018 judge fourteen joints, without the neck."""


def published_on(benchmark: Benchmark) -> tuple[Published, ...]:
    """The published figures of a benchmark; of a simulated one none, whatever its name."""
    return PUBLISHED.get(benchmark.name, ()) if benchmark.origin is Origin.REAL else ()
