"""The comparison as a table and as JSON."""

from dataclasses import asdict, dataclass

import numpy as np

from synth.realism.statistics import STATISTICS, Statistic

Z_95 = 1.96


@dataclass(frozen=True)
class Summary:
    """Many values in three numbers.

    Attributes:
        middle: the median; of a share its value.
        low: the lower quartile; of a share the lower end of its 95 % interval.
        high: the upper quartile, or upper end.
        count: number of values.
    """

    middle: float
    low: float
    high: float
    count: int


@dataclass(frozen=True)
class Line:
    """One statistic of generated data, beside one real set or alone.

    Attributes:
        statistic: its name.
        unit: of the numbers.
        real_set: the real set, "" if the statistic is known for generated data only.
        real: its summary, None without a real set.
        synthetic: the summary of the generated data, None where it cannot be measured.
        inside: whether the generated middle lies between the real low and high; None where one of them lacks.
        gap: distance of the middles in units of the real range from low to high, signed; None where one lacks.
    """

    statistic: str
    unit: str
    real_set: str
    real: Summary | None
    synthetic: Summary | None
    inside: bool | None = None
    gap: float | None = None


def summary(values: np.ndarray, is_share: bool) -> Summary | None:
    """Median and quartiles, or a share with its 95 % interval (Wilson 1927); None without values."""
    count = len(values)
    if not count:
        return None
    if not is_share:
        low, middle, high = np.percentile(values, (25, 50, 75)).tolist()
        return Summary(middle, low, high, count)
    share = float(np.mean(values))
    centre = (share + Z_95**2 / (2 * count)) / (1 + Z_95**2 / count)
    half = Z_95 / (1 + Z_95**2 / count) * float(np.sqrt(share * (1 - share) / count + Z_95**2 / (4 * count**2)))
    return Summary(share, centre - half, centre + half, count)


def compare(real: dict[str, dict[str, np.ndarray]], synthetic: dict[str, np.ndarray]) -> list[Line]:
    """A line for each statistic and each real set that knows it.

    Args:
        real: values of each statistic by its name, by the name of the real set.
        synthetic: values of each statistic by its name.
    """
    lines = []
    for statistic in STATISTICS:
        ours = summary(synthetic[statistic.name], statistic.is_share)
        theirs = {name: summary(values[statistic.name], statistic.is_share) for name, values in real.items()}
        known = {name: one for name, one in theirs.items() if one is not None}
        for name, one in known.items():
            lines.append(_line(statistic, name, one, ours))
        if not known and ours is not None:
            lines.append(Line(statistic.name, statistic.unit, "", None, ours))
    return lines


def _line(statistic: Statistic, real_set: str, real: Summary, ours: Summary | None) -> Line:
    if ours is None:
        return Line(statistic.name, statistic.unit, real_set, real, None)
    inside = real.low <= ours.middle <= real.high
    gap = (ours.middle - real.middle) / max(real.high - real.low, 1e-9)
    return Line(statistic.name, statistic.unit, real_set, real, ours, inside, gap)


def verdict(lines: list[Line]) -> dict[str, float | int]:
    """How many lines could be compared, how many of them are inside, and the median of their absolute gaps."""
    gaps = [abs(line.gap) for line in lines if line.gap is not None]
    inside = sum(line.inside is True for line in lines)
    return {"compared": len(gaps), "inside": inside, "median_gap": float(np.median(gaps)) if gaps else 0.0}


def as_text(lines: list[Line], notes: list[str]) -> str:
    """The table for people, with notes about what was left out."""
    rows = [("statistic", "unit", "real set", "real: median [quartiles] n", "synthetic: median [quartiles] n", "inside", "gap")]
    for line in lines:
        inside = {True: "yes", False: "NO", None: "-"}[line.inside]
        gap = "-" if line.gap is None else f"{line.gap:+.1f}"
        rows.append((line.statistic, line.unit, line.real_set or "-", _shown(line.real), _shown(line.synthetic), inside, gap))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    text = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    found = verdict(lines)
    text.append("")
    text.append(
        f"{found['inside']} of {found['compared']} medians inside the real quartiles; median gap "
        f"{found['median_gap']:.2f} (distance of the medians in real interquartile ranges; of shares: 95 % intervals)"
    )
    return "\n".join([*text, *notes])


def _shown(one: Summary | None) -> str:
    return "-" if one is None else f"{one.middle:.3g} [{one.low:.3g}, {one.high:.3g}] {one.count}"


def as_json(lines: list[Line], notes: list[str], settings: dict) -> dict:
    """The same for programs."""
    return {"settings": settings, "verdict": verdict(lines), "lines": [asdict(line) for line in lines], "notes": notes}
