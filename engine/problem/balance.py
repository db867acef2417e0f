"""How the aims of the sampler are weighed against each other.

The paper is Schmaltz, Gwosdek and Weickert 2012.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from . import validation
from .settings import Settings, belongs_to, described, setting

__all__ = ["Balance"]

# Times that a class counts as rarer than the largest, at most: few bodies need no more to be even.
MOST_RARE = 100.0
# Times that the bodies of another class may be larger before a class counts as one of small ones; and times that it does, at most.
# Large ones push small ones by their charge; with 2, these push each other half as strongly then as large ones push them. Of 1,561
# bodies beside 175 of eighty times their area the mean distance to the next is .85 of the root of the ground that each has, and was
# .34; the error of all of them at 1 spacing is .149, and was .140. With 1 instead of 2 it is .91 and .158, and two classes, one with
# bodies three times as large, lose a third of being even together.
TIMES_AS_LARGE, MOST_SMALL = 2.0, 10_000.0
# Times that the own factor of a class is raised at most.
MOST_RAISED = 1e6
# Power of the rarity of two rare classes by which they push each other more. Without it each cares for itself alone, and all are
# uneven together: with 1,000, 300, 100 and 30 bodies the error of all at 1 spacing is 1.5 times that of the paper's factors, and 1.07
# times with it. With more, classes of middling counts are less even by themselves.
SHARED_POWER = 0.7


@belongs_to("problem")
@described
@dataclass(frozen=True, eq=False)
class Balance(Settings):
    """How the aims of the sampler are weighed against each other.

    Raises:
        ProblemError: A value outside these ranges, or factors with a negative eigenvalue.
    """

    class_separation: float = field(
        default=0.5,
        metadata=setting(
            "0: each class is evenly spaced by itself, wherever the others are. 1: only all classes together are evenly spaced, "
            "so they mix",
            more="The alpha of Schmaltz, Gwosdek and Weickert 2012",
            label="Mix Classes",
            unit="share",
            low=0.0,
            high=1.0,
            check=validation.check_class_separation,
        ),
    )
    size_emphasis: float | Sequence[float] = field(
        default=2.0,
        metadata=setting(
            "How evenly the larger sizes are spread among themselves. 1 treats all sizes alike",
            more="The C >= 1 of Schmaltz, Gwosdek and Weickert 2012, with C_i = C^i for size rank i; or the list C_1, C_2, ..., "
            "one for each larger size. For sizes that are a range, it is the square of C that every doubling of the area adds as a "
            "factor: C = 2 is the paper's min(A_j², A_k²)",
            label="Favor Large",
            low=1.0,
            high=1e6,
            soft_high=8.0,
            check=validation.check_size_emphasis,
        ),
    )
    non_overlap: np.ndarray | Sequence[Sequence[float]] | None = field(
        default=None,
        metadata=setting(
            "Which classes make room for each other: 1 where two do, 0 where each is spread as if the other were not there. "
            "None: all do",
            more="It keeps footprints apart only with ``avoid_overlap``, and then those of all pairs that are not 0. One row and "
            "column per class, symmetric, 1 on the diagonal (section 5 of Schmaltz, Gwosdek and Weickert 2012). "
            "The classes' factors are (1 - alpha) identity + alpha non_overlap",
            check=validation.check_non_overlap,
        ),
    )
    rare_emphasis: float = field(
        default=1.0,
        metadata=setting(
            "How evenly classes of few or small objects are spread beside others of many or larger ones. 0 treats all classes alike",
            more="A class's own factor is multiplied by its rarity times its smallness, to this power. Rarity is the largest count "
            "of a class over its own, at most 100; smallness is half of the largest area over its own, at least 1. "
            "Where overlap is avoided it is less, so that small objects stand in no closed row around large ones, and much smaller "
            "sizes of one class get such a factor as well, so that there is no bare ground around the large ones. "
            "Rare classes of like areas also push each other more. 0 is the paper's",
            label="Favor Rare",
            low=0.0,
            high=2.0,
        ),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.non_overlap is not None:
            validation.check_class_matrix(np.asarray(self.non_overlap), self.class_separation, self._key("non_overlap"))

    def _key(self, name: str) -> str:
        return f"`balance.{name}`"

    @property
    def classes_apart(self) -> np.ndarray | None:
        """Which classes keep apart in contact, shape ``[class_count, class_count]``, bool; None where all do."""
        apart = None if self.non_overlap is None else np.asarray(self.non_overlap) > 0.0
        return None if apart is None or apart.all() else apart

    def of_some(self, chosen: Sequence[int], most_sizes: int) -> Balance:
        """Return the balance of some of the classes, which have no more than so many sizes.

        Args:
            chosen: Their indices.
            most_sizes: How many sizes one of them has at most.
        """
        apart = None if self.non_overlap is None else np.asarray(self.non_overlap)[np.ix_(chosen, chosen)]
        emphasis = self.size_emphasis
        if isinstance(emphasis, tuple):
            emphasis = emphasis[: most_sizes - 1] or 1.0
        return replace(self, non_overlap=apart, size_emphasis=emphasis)

    def class_factors(
        self, counts: Sequence[int], areas: Sequence[float], most_alone: np.ndarray | None = None
    ) -> np.ndarray:
        """Factors between classes, shape ``[class_count, class_count]``, float64.

        (1 - alpha) identity + alpha non_overlap. The identity of a class is raised that has fewer or smaller bodies than others; and
        non_overlap between two that are both rare, by what they share of it, so that they are even together, too. The more their areas
        differ, the less it is: small ones do not see large ones as theirs. Whatever is added has no negative eigenvalue.

        Args:
            counts: Bodies of every class.
            areas: Footprint of the largest bodies of every class, in any unit.
            most_alone: What the identity of every class is raised to at most, above 0; None for any.
        """
        count, area = np.asarray(counts, np.float64), np.asarray(areas, np.float64)
        apart = np.ones((len(count), len(count))) if self.non_overlap is None else np.asarray(self.non_overlap)
        rarity = np.minimum(count.max() / count, MOST_RARE)
        smallness = np.clip(area.max() / (TIMES_AS_LARGE * area), 1.0, MOST_SMALL)
        own = np.minimum((rarity * smallness) ** self.rare_emphasis, MOST_RAISED)
        if most_alone is not None:
            own = np.minimum(own, most_alone ** min(self.rare_emphasis, 1.0))
        alike = np.minimum.outer(area, area) / np.maximum.outer(area, area)
        raised = (np.minimum.outer(rarity, rarity) ** (SHARED_POWER * self.rare_emphasis) - 1.0) * alike
        alpha = self.class_separation
        return (1.0 - alpha) * np.diag(own) + alpha * apart * (1.0 + (1.0 - alpha) * raised)
