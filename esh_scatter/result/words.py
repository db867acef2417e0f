"""What a report says, in the words of the sidebar. Knows nothing of Blender."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ...engine.problem.note import NoteKind, kind_of

if TYPE_CHECKING:
    from ...engine.problem.cover import Cover

__all__ = [
    "CLUMPED",
    "COUNTED_AGAIN",
    "COUNTING",
    "HELD",
    "LEANING_CHANGED",
    "MAY_OVERLAP",
    "NOTE_KINDS",
    "NOTHING_LEANS",
    "SHOWN_SCALE",
    "UNBROKEN",
    "behind_rule",
    "beside_others",
    "cover",
    "evenness",
    "evenness_word",
    "has_trouble",
    "held",
    "in_the_way",
    "kept",
    "leaning",
    "leans",
    "leans_by_now",
    "meters",
    "notes",
    "overlaps",
    "placed",
    "summary",
    "unevenness",
    "updated",
    "worst",
]

# Coverage errors up to which a placement looks even. Independent random points have 0.31, Poisson disks 0.07. Crowds beside obstacles
# and at borders reach a little above 0.1, where nothing of it is seen.
VERY_EVEN = 0.04
EVEN = 0.15
# Share of the objects from which on a crowded region is spoken of.
LEAST_CROWDED = 0.01
# What of a report that is kept says whether objects were let overlap: then it is no trouble that they do.
MAY_OVERLAP = "may_overlap"
# And whether some were to stand in clumps: neither they nor what lies around these is even then.
CLUMPED = "clumped"
# And what each of its notes is about, which texts alone do not say.
NOTE_KINDS = "note_kinds"
# And what has held the number of objects, as a sentence.
HELD = "held"
# And whether objects stand otherwise than when it was counted how many lean into each other.
LEANING_CHANGED = "leaning_changed"
# Of these, whether they are being counted again; otherwise nobody can.
COUNTING = "leaning_counting"
# Or whether it is told how many lean as they stand by now, and how much larger they are shown than they were placed.
COUNTED_AGAIN, SHOWN_SCALE = "leaning_counted_again", "shown_scale"
# What a report says where nothing leans.
NOTHING_LEANS = {"leaning": None, "deepest_leaning": 0.0, "leaning_pair": None, "leaning_bodies": ()}
# What a report says where nothing lies where it is not to lie.
NO_OVERLAP = "no overlap"
# A space at which no line is broken.
UNBROKEN = "\u00a0"
# Fewer than this have no evenness to speak of.
FEWEST = 4


def evenness_word(error: float) -> str:
    """Return what a coverage error looks like."""
    if error <= VERY_EVEN:
        return "very even"
    return "even" if error <= EVEN else "uneven"


def unevenness(report: dict[str, Any]) -> float:
    """Return the coverage error that tells how a placement looks.

    Classes that mix are even together and not each alone, classes that do not are even alone; the better of the two counts.
    """
    return float(min(report["coverage_error"], max(entry["coverage_error"] for entry in report["classes"])))


def evenness(report: dict[str, Any]) -> str:
    """Return how even a placement is, and where it is not: "uneven: Pine"; empty for a handful of bodies, and where no figure tells.

    Classes that larger bodies keep off part of their ground are not counted among the uneven ones. See :func:`unevenness`.
    """
    if placed(report) < FEWEST:
        return ""
    kept_off = NoteKind.AROUND_LARGER in _kinds(report)
    counted = [entry for entry in report["classes"] if not entry.get("kept_off", False)]
    if kept_off and (not counted or len(counted) == len(report["classes"])):
        # Reports of files that were saved by earlier versions do not say which are.
        return ""
    meant = report.get(CLUMPED, False) or NoteKind.ERROR_OF_FEW in _kinds(report)
    word = evenness_word(unevenness({**report, "classes": counted}))
    if word != "uneven":
        # That the others are even, or all of them together, says nothing of those that are kept off.
        return "" if kept_off else word
    if meant or len(report["classes"]) == 1:
        return "" if meant else word
    uneven = [entry["name"] for entry in counted if entry["coverage_error"] > EVEN]
    return f"uneven: {', '.join(uneven[:3])}" + (" and others" if len(uneven) > 3 else "")


def summary(report: dict[str, Any], unbroken: str = " ", *, seconds: bool = True) -> str:
    """Return a report in one line: "1,042 placed · no overlap · very even · 0.8 s"; ``unbroken`` is the space within its parts."""
    parts = [f"{placed(report):,} placed", *_contacts(report), evenness(report)]
    if seconds:
        parts.append(f"{report['seconds']:.1f} s")
    return " · ".join(part.replace(" ", unbroken) for part in parts if part)


def in_the_way(names: Sequence[str]) -> str:
    """Say which later scatters stand where a scatter has placed objects since; empty where none does."""
    if not names:
        return ""
    quoted = [f'"{name}"' for name in names]
    if len(names) == 1:
        return f"{quoted[0]} does not make room for this yet: update it, too"
    more = f"{', '.join(quoted[:2])} and {len(names) - 2} more" if len(names) > 2 else " and ".join(quoted)
    return f"{more} do not make room for this yet: update them, too"


def updated(names: Sequence[str]) -> str:
    """Say which scatters were updated together."""
    quoted = [f'"{name}"' for name in names]
    if not quoted:
        return "No scatter was updated"
    if len(quoted) > 3:
        return f"{', '.join(quoted[:2])} and {len(quoted) - 2} more updated"
    return f"{' and '.join(filter(None, (', '.join(quoted[:-1]), quoted[-1])))} updated"


def has_trouble(report: dict[str, Any]) -> bool:
    """Whether anything lies where it is not to lie: in another object, an obstacle, or across the border."""
    return _troubles(report) not in ([], [NO_OVERLAP])


def _contacts(report: dict[str, Any]) -> list[str]:
    """Return what lies where it is not to lie, and what meets above the ground: "no overlap on the ground", "12 pairs lean …"."""
    found, lean = _troubles(report), _lean(report)
    if lean and found == [NO_OVERLAP]:
        # Of larger ones nobody has looked at the ground.
        found = ["no overlap on the ground"] if _shown_scale(report) == 1.0 else []
    return [*found, *lean]


def _shown_scale(report: dict[str, Any]) -> float:
    return float(report.get(SHOWN_SCALE, 1.0))


def _lean(report: dict[str, Any]) -> list[str]:
    """Return how many pairs lean into each other, or that nobody knows; nothing where none does, or where they may."""
    count = report.get("leaning")
    if report.get(MAY_OVERLAP, False) or count is None:
        return []
    if report.get(LEANING_CHANGED, False):
        return ["counting what leans …" if report.get(COUNTING, False) else "leaning not counted again"]
    if not count:
        return []
    what, s = ("1 pair", "s") if count == 1 else (f"{count:,} pairs", "")
    if _shown_scale(report) != 1.0:
        return [f"{what} meet{s} at Scale {_shown_scale(report):.3g}"]
    return [f"{what} lean{s} into each other"]


def leans_by_now(report: dict[str, Any]) -> str:
    """Return how many pairs lean into each other as objects are shown since the run; empty where that is as it was, or none does."""
    return "".join(_lean(report)) if report.get(COUNTED_AGAIN, False) else ""


def leans(report: dict[str, Any]) -> bool:
    """Whether objects lean into each other, or may do so by now."""
    return bool(_lean(report))


def _troubles(report: dict[str, Any]) -> list[str]:
    """Return what lies where it is not to lie: "12 overlaps", "2 in obstacles"; "no overlap" where nothing does that must not."""
    may = report.get(MAY_OVERLAP, False)
    found = [_overlaps(count)] if (count := report["overlaps"]) and not may else []
    # Reports of files that were saved by earlier versions have none of these.
    if count := report.get("fixed_overlaps", 0):
        found.append(f"{_overlaps(count)} among pinned")
    if count := report.get("in_obstacles", 0):
        found.append(f"{count:,} in obstacles")
    if count := report.get("beyond_border", 0):
        found.append(f"{count:,} across the border")
    return found or ([] if may else [NO_OVERLAP])


def _overlaps(count: int) -> str:
    return f"{count:,} overlap{'s' * (count != 1)}"


def notes(report: dict[str, Any], *, foreseen: bool = False) -> list[str]:
    """Return the sentences of a report that are worth attention, as a panel shows them; more steps only where they would help.

    Where it is ``foreseen`` how much ground footprints take, and said below the button, that is not said again.
    """
    # How many overlap, and how deep, has a line of its own, and whoever lets them overlap has switched Avoid Overlap off; and neither
    # coverage errors are shown that would have to be explained, nor settings that do nothing.
    elsewhere = {
        NoteKind.OVERLAPS,
        NoteKind.MAY_OVERLAP,
        NoteKind.ERROR_OF_FEW,
        NoteKind.ALL_TOGETHER,
        NoteKind.IGNORED,
        *([NoteKind.COVER] if foreseen else []),
    }
    told = zip(report["notes"], _kinds(report), strict=True)
    found = [_in_blender(note) for note, kind in told if kind not in elsewhere]
    # Where many overlap there is no room to be even in.
    crowded = report["overlaps"] > LEAST_CROWDED * placed(report)
    if not report["converged"] and not crowded and evenness(report).startswith("uneven"):
        found.append("more steps would make it more even (Advanced)")
    return [note[:1].upper() + note[1:] for note in found]


def kept(report: dict[str, Any]) -> dict[str, Any]:
    """Return a report as it can be kept as JSON: with what its notes are about."""
    return {**report, NOTE_KINDS: [str(kind) for kind in _kinds(report)]}


def _kinds(report: dict[str, Any]) -> list[str]:
    """Return what each note of a report is about: as its file says, or as the notes do that come from the engine."""
    return report.get(NOTE_KINDS) or [kind_of(note) for note in report.get("notes", ())]


# What the sidebar calls what reports have other words for.
_IN_BLENDER = (
    ("`", ""),
    ("fixed bodies", "pinned objects"),
    ("fixed body", "pinned object"),
    ("1 body ", "1 object "),
    (" bodies ", " objects "),
    ("take more steps", "raise Max Steps (Advanced)"),
    ("lower the counts or the areas", "lower counts or Scale"),
    ("a lower class_separation lets", "a lower Mix Classes lets"),
)


def _in_blender(note: str) -> str:
    """Return a sentence of a report in the words of the sidebar."""
    for word, here in _IN_BLENDER:
        note = note.replace(word, here)
    return note


def overlaps(report: dict[str, Any]) -> str:
    """Return how many pairs of footprints overlap: "12 pairs"."""
    return _pairs(report["overlaps"])


def leaning(report: dict[str, Any]) -> str:
    """Return how many pairs meet above the ground or below it: "12 pairs"; empty where nothing leans."""
    count = report.get("leaning")
    if count is None:
        return ""
    if report.get(LEANING_CHANGED, False):
        return "counting …" if report.get(COUNTING, False) else "changed since"
    return _pairs(count)


def _pairs(count: int) -> str:
    return f"{count:,} pair{'s' * (count != 1)}" if count else "none"


def worst(report: dict[str, Any]) -> tuple[tuple[int, int], float] | None:
    """Return which two objects lie deepest in each other, on the ground before above it, and how deep [m]; None where none do."""
    if report["overlaps"] and report.get("deepest_pair") is not None:
        return tuple(report["deepest_pair"]), report["deepest_overlap"]
    if report.get("leaning") and report.get("leaning_pair") is not None and not report.get(LEANING_CHANGED, False):
        return tuple(report["leaning_pair"]), report["deepest_leaning"]
    return None


def held(most: int, share: float, wanted: int) -> str:
    """Return that a limit has held the number of objects: "Held at 2,000 by Max Objects: 25% cover would take 1,250,000"."""
    return f"Held at {most:,} by Max Objects: {100.0 * share:.3g}% cover would take {wanted:,}"


def beside_others(left: int, wanted: int) -> str:
    """Return that there are fewer objects because others stand on the ground: "Only 31 of 49 have room between the others there"."""
    return f"Only {left:,} of {wanted:,} have room between the others there"


def cover(found: Cover) -> str:
    """Return what cannot be avoided, before a run: "covers 131%, about 78% fits"; empty where nothing need be said."""
    if found.too_much:
        return f"Overlap is unavoidable: it covers {found.covered:.0%} of the ground, about {found.fits:.0%} fits"
    if found.crowded > LEAST_CROWDED:
        return f"Too crowded in places: {found.crowded:.0%} of the objects go where not all fit. Lower counts, or even densities out"
    return ""


def behind_rule(message: str) -> str:
    """Return what a message says of what was given, without the rule before it: "Image ... is 0 everywhere"."""
    given = message.rpartition("; ")[2]
    return given[:1].upper() + given[1:]


def meters(length: float) -> str:
    """Return a length with as many digits as are worth reading."""
    if length >= 100.0:
        return f"{length:,.0f} m"
    return f"{length:.1f} m" if length >= 10.0 else f"{length:.2f} m" if length >= 0.1 else f"{length:.2g} m"


def placed(report: dict[str, Any] | None) -> int:
    """Return how many objects a run has placed; 0 before the first."""
    return sum(size["placed"] for entry in (report or {}).get("classes", ()) for size in entry["sizes"])
