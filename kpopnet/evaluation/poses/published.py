"""Published results on real benchmarks, shown beside ours there and never beside results on simulated depth."""

from typing import NamedTuple

from kpopnet.datasets.protocol import Benchmark, Origin


class Published(NamedTuple):
    """Published results over all joints of their method; None where a metric is not published.

    Attributes:
        method: authors, year and method.
        map_10cm: fraction of joints within 10 cm, 0..1.
        pose_error_cm: average pose error (Eq. 16) in cm.
    """

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
"""By the name of the benchmark. Kim & Kim 2018 have fourteen joints, without the neck, as `map_14` of `metrics.evaluate`."""


def published_on(benchmark: Benchmark) -> tuple[Published, ...]:
    """The published results on a benchmark; none on a simulated one, whatever its name."""
    return PUBLISHED.get(benchmark.name, ()) if benchmark.origin is Origin.REAL else ()
