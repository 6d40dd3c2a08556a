"""Settings of the paper's tracker: the parameters that the paper names, and every repair as a switch of its own."""

from dataclasses import dataclass, field

from kpopnet.errors import InputError
from kpopnet.paper_tracker.rules import Settings
from kpopnet.ridge import RidgeConfig


@dataclass(frozen=True)
class HierarchyConfig:
    """Parameters of Algorithm 2.

    Attributes:
        candidates: ridge (raw depth only where ridge data are insufficient) or depth (raw depth only, the comparison of
            Fig. 10).
        r_m: search radius of a joint in metres, r_j of Eqs. (4) and (12).
        epsilon_m: tolerance of lengths in metres, epsilon_j of Eqs. (5) to (9).
        straightness: minimum ratio of straight to geodesic distance, epsilon_L of Eq. (9).
    """

    candidates: str = "ridge"
    r_m: float = 0.11
    epsilon_m: float = 0.05
    straightness: float = 0.7

    def __post_init__(self) -> None:
        if self.candidates not in ("ridge", "depth"):
            raise InputError(f"hierarchy.candidates={self.candidates}: expected ridge or depth")
        if not (0 < self.r_m <= 2 and 0 < self.epsilon_m <= 1 and 0 <= self.straightness < 1):
            raise InputError(
                "hierarchy: expected r_m in 0..2 m, epsilon_m in 0..1 m and straightness in 0..1, found "
                f"{self.r_m}, {self.epsilon_m} and {self.straightness}"
            )


@dataclass(frozen=True)
class Repairs:
    """What the paper's text leaves insufficient, mended; each on its own. All off: Algorithm 2 as printed.

    The gains are those of all repairs over all but this one, in joints within 10 cm in simulated slow motion: 22 % as printed,
    84 % with all repairs. docs/trackers.md has the reasons at length and more figures.

    Attributes:
        still: no velocity in Eq. (3), which feeds the noise of every joint back undamped. 10 points.
        head_to_shoulder: also the distance from head to shoulder in Eq. (6), without which both shoulders may slide along their
            line; the angles of section 2.3 give it. 31 points.
        rising_shoulders: the shoulders' lengths follow the arms, which lift them by 5 cm in the Y pose. 4 points.
        depth_near_trunk: raw depth for the joints of the trunk and the elbows, where there are no ridge data. 11 points.
        wider_when_lost: r_j doubled for joints lost for more than five frames. Nothing in slow motion, at 30 fps 2.
    """

    still: bool = False
    head_to_shoulder: bool = False
    rising_shoulders: bool = False
    depth_near_trunk: bool = False
    wider_when_lost: bool = False


ALL_REPAIRS = Repairs(*(True for _ in range(5)))


@dataclass(frozen=True)
class PaperTrackerConfig:
    """Settings of the paper's tracker.

    Attributes:
        hierarchy: parameters of Algorithm 2.
        repairs: what is mended; by default nothing.
        ridge: parameters of the ridge data.
    """

    hierarchy: HierarchyConfig = field(default_factory=HierarchyConfig)
    repairs: Repairs = field(default_factory=Repairs)
    ridge: RidgeConfig = field(default_factory=RidgeConfig)

    @property
    def for_kernels(self) -> Settings:
        hierarchy, repairs = self.hierarchy, self.repairs
        return Settings(
            hierarchy.r_m,
            hierarchy.epsilon_m,
            hierarchy.straightness,
            hierarchy.candidates == "depth",
            repairs.still,
            repairs.head_to_shoulder,
            repairs.rising_shoulders,
            repairs.depth_near_trunk,
            repairs.wider_when_lost,
        )


AS_PRINTED = PaperTrackerConfig()
