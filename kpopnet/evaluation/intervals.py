"""Bootstrap intervals of pooled figures, by resampling whole units of correlated frames, and paired comparisons.

Frames of one unit (a person, a sequence, or all stills of one room before one camera) share what makes them easy or hard, so
they count as one draw from the population: whole units are resampled with replacement. Frames that are resampled one by one
pretend to be independent, and give an interval that is several times too narrow.

All figures are ratios of sums over frames, as joints within 10 cm to labelled joints; a resample weights the sums of units.
"""

import numpy as np
from scipy.special import ndtr, stdtrit

from kpopnet.errors import check_seed

DRAWS = 4000
LEVEL = 0.95
FEWEST_UNITS = 5
"""With fewer units there is no interval: what it would cover depends on the unknown shape of their distribution."""


def percentiles(units: int) -> tuple[float, float]:
    """The percentiles of the bootstrap distribution that are the ends of a LEVEL interval, for at least two units.

    Plain percentiles (2.5, 97.5) are too narrow for few units: the resampled variance is (n - 1) / n of the unbiased one, and
    normal quantiles stand where Student's belong. Hesterberg's expanded percentiles mend both: "What teachers should know about
    the bootstrap", The American Statistician 69(4), 2015.
    """
    quantile = stdtrit(units - 1, (1 - LEVEL) / 2) * np.sqrt(units / (units - 1))
    tail = 100 * float(ndtr(quantile))
    return tail, 100 - tail


class Bootstrap:
    """The same resamples of units for every figure that is asked of it, so that differences of figures are paired.

    Attributes:
        units: number of different units.
    """

    def __init__(self, unit: np.ndarray, seed: int) -> None:
        """`unit` is the number of the unit of each frame (N,); the numbers need not be dense."""
        check_seed("seed", seed)
        _, self._row = np.unique(unit, return_inverse=True)
        self.units = int(self._row.max(initial=-1)) + 1
        shares = np.full(self.units, 1 / max(self.units, 1))
        enough = self.units >= FEWEST_UNITS
        self._draws = np.random.default_rng(seed).multinomial(self.units, shares, size=DRAWS) if enough else None

    def ratios(self, numerator: np.ndarray, denominator: np.ndarray) -> np.ndarray:
        """(DRAWS,) ratios of the sums of two (N, K) arrays, NaN where the lower sum is 0; (0,) below FEWEST_UNITS units."""
        above, below = (self.sums(values.sum(axis=1, keepdims=True))[:, 0] for values in (numerator, denominator))
        return np.divide(above, below, out=np.full(len(below), np.nan), where=below > 0)

    def sums(self, values: np.ndarray) -> np.ndarray:
        """(DRAWS, K) sums of (N, K) values in each resample; without rows with fewer than two units."""
        if self._draws is None:
            return np.empty((0, values.shape[1]))
        return self._draws @ np.stack([np.bincount(self._row, column, self.units) for column in values.T], axis=1)

    def interval(self, numerator: np.ndarray, denominator: np.ndarray) -> list[float] | None:
        """`interval_of` the ratio of the sums of two (N, K) arrays, over the units that add to the lower sum."""
        adds = np.bincount(self._row, denominator.sum(axis=1), self.units) > 0
        return interval_of(self.ratios(numerator, denominator), np.count_nonzero(adds))


def interval_of(draws: np.ndarray, units: int) -> list[float] | None:
    """The LEVEL interval [low, high] of a figure from its values in all resamples, and the number of units that it rests on.

    It covers the variation over other units of the same kind, not over units of another kind. None below FEWEST_UNITS units,
    and where all resamples have the same value but for rounding, as at 0 and 100 %: they say nothing about how it varies.
    """
    defined = draws[np.isfinite(draws)]
    if units < FEWEST_UNITS or not defined.size or np.ptp(defined) <= 1e-9 * np.abs(defined).max():
        return None
    return np.percentile(defined, percentiles(units)).tolist()
