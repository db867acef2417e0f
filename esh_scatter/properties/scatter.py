"""What the sidebar holds of a scatter: its target, its classes, the result and report of its last run."""

# Properties are annotations that are calls, which Blender reads and mypy cannot.
# mypy: disable-error-code="valid-type"

import itertools
import json
import random
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty, PointerProperty, StringProperty
from bpy.types import PropertyGroup

from ...engine.problem.scatter_settings import ScatterSettings, Standing
from ...engine.problem.settings import settings_of
from ..classes.name_lists import joined_names
from ..result import words
from ..targets import checksums
from ..targets.in_scenes import in_a_scene, is_in
from ..targets.target import RESULT_TARGET
from . import changed_settings, settings_record
from .asked_once import asked_once
from .body_class import CLASS_COLORS, ESH_PG_class
from .described import values_from, with_properties
from .entries import entry_at
from .kept_settings import keep_settings
from .names import NEW_CLASS, scatter_renamed, take_name_of_result, unused_name
from .obstacle import ESH_PG_free_place, ESH_PG_obstacle
from .placed import ESH_PG_placed, remember_placed, replaced
from .shown_at_once import show_class_anew, stand_class_anew
from .target import WithTarget

__all__ = ["BY_HAND", "CLASSES", "ESH_PG_scatter"]

# What a size places.
SOURCES = ("source_object", "source_collection")
# Settings of a scatter that the sidebar has in a form of its own: names of classes that may overlap, and standing by class.
BY_HAND = ("non_overlap", *settings_of(Standing))


def _live_switched(item: "ESH_PG_scatter", context: object) -> None:
    """Follow this scatter, or no longer."""
    from ..solving import live

    item.own_uid()
    live.switched(item, context)


@with_properties(ScatterSettings, BY_HAND)
class ESH_PG_scatter(WithTarget, PropertyGroup):
    """One scatter: a target, what stands on it, and the report of its last run."""

    KIND = "Scatter"

    name: StringProperty(
        name="Name", description="Name of this scatter and of the object that it makes", update=scatter_renamed
    )
    classes: CollectionProperty(type=ESH_PG_class)
    class_index: IntProperty(name="Selected Class", description="The class that is shown below the list")
    obstacles: CollectionProperty(type=ESH_PG_obstacle, name="Obstacles")
    free_places: CollectionProperty(type=ESH_PG_free_place, name="Instances set by hand", options={"HIDDEN"})
    obstacle_index: IntProperty(name="Selected Obstacle", description="The obstacle that is shown below the list")
    keep_off_others: BoolProperty(
        name="Other Scatters",
        description="Keep away from what scatters that were added earlier have placed on the same target",
        default=True,
    )
    result: PointerProperty(
        type=bpy.types.Object, name="Result", description="The object that the last run made. The next run replaces it"
    )
    uid: IntProperty(options={"HIDDEN"})
    live: BoolProperty(
        name="Live",
        description="Update the result while settings, painted images and weights, the target or the objects to place change. "
        "What is far from a change stays where it is",
        default=False,
        update=_live_switched,
    )
    points_above: IntProperty(
        name="Points Above",
        description="Results with more objects than this are first shown as points in the viewport. Renders always show the objects",
        default=100_000,
        min=0,
        soft_max=10_000_000,
    )
    cap: IntProperty(
        name="Confirm At",
        description="Ask before placing this many objects or more, with an estimate of time and memory",
        default=1_000_000,
        min=1,
        soft_max=10_000_000,
    )
    report_json: StringProperty(options={"HIDDEN"})
    ran_with: StringProperty(options={"HIDDEN"})
    placed: CollectionProperty(type=ESH_PG_placed, options={"HIDDEN"})

    @property
    def active_class(self) -> ESH_PG_class | None:
        """The selected class, or None."""
        return entry_at(self.classes, self.class_index)

    @property
    def active_obstacle(self) -> ESH_PG_obstacle | None:
        """The selected obstacle, or None."""
        return entry_at(self.obstacles, self.obstacle_index)

    def other_results(self) -> list[bpy.types.Object]:
        """Return what the scatters before this one have placed on the same target: those after it make room themselves."""
        if not self.keep_off_others:
            return []
        before = itertools.takewhile(lambda other: other != self, self.id_data.esh_scatter.scatters)
        found = (other.result_in(self.id_data) for other in before if self._stands_beside(other))
        return [result for result in found if result is not None]

    def _stands_beside(self, other: "ESH_PG_scatter") -> bool:
        return bool(set(other.targets) & set(self.targets))

    def later_in_the_way(self) -> list["ESH_PG_scatter"]:
        """Return the scatters after this one that keep off it, but have not been run since its objects are where they are.

        What Live follows makes room by itself.
        """
        result, scatters = self.result_in(self.id_data), list(self.id_data.esh_scatter.scatters)
        later = [
            other
            for other in scatters[scatters.index(self) + 1 :]
            if other.keep_off_others and not other.live and self._stands_beside(other) and other.result_in(self.id_data)
        ]
        if result is None or not later:
            return []
        records = [_parse_record(other.ran_with).get("scatter") for other in later]
        points = checksums.of_points(result)
        known = zip(later, records, strict=True)
        return [other for other, then in known if then is not None and points not in then.get("keep_off_others", ())]

    @property
    def report(self) -> dict | None:
        """The last run's report, as :meth:`~esh.engine.problem.report.Report.to_dict` gives it, or None before the first."""
        return _parse_report(self.report_json)

    def report_as_it_stands(self, *, wait: bool = False) -> dict | None:
        """Return :attr:`report`, which then says which objects lean into each other as they stand by now.

        They may stand otherwise than when the run counted. Then that is counted again: at once where somebody has to ``wait`` for it,
        and without a window; otherwise it is said that it will be.
        """
        from ..result.leaning_now import LEANING_OF, factor_shown
        from ..solving import counted_again

        report, result = self.report, self.result_in(self.id_data)
        number = "" if report is None or result is None else counted_again.number_of(result, exactly=wait)
        if report is None or result is None or not number or result.data.get(LEANING_OF) == number:
            if result is not None:
                counted_again.needless(result)
            return report
        told = bool(report["overlaps"] or report.get("fixed_overlaps", 0))
        found = counted_again.counted(self, result, number, told=told, wait=wait)
        if found is None or not found.known:
            return {**report, words.LEANING_CHANGED: True, words.COUNTING: found is None}
        leaning = words.NOTHING_LEANS if found.leaning is None else found.leaning.as_reported()
        return {**report, **leaning, words.COUNTED_AGAIN: True, words.SHOWN_SCALE: factor_shown(result)}

    @property
    def outdated(self) -> bool:
        """Whether something differs from what the last run was made with. Cheap enough to ask while drawing."""
        if not self.report_json:
            return False
        return bool(replaced(self)) or not settings_record.same(
            *self._read_by_solver(self._ran_with_record(), self.record())
        )

    def changes(self, now: dict | None = None) -> list[str]:
        """Name what differs from what the last run was made with: "count of Pine"; empty where nothing does, or before a run.

        ``now`` is the :meth:`record` of now, where that has been made.
        """
        if not self.report_json:
            return []
        before, now = self._read_by_solver(self._ran_with_record(), now or self.record())
        others = replaced(self)
        if settings_record.same(before, now):
            return others
        # What another object has changed with it need not be said.
        found = changed_settings.changes(before, now, self)
        return list(dict.fromkeys([*others, *found]))

    def _read_by_solver(self, *records: dict) -> tuple[dict, ...]:
        """Return records without what of how objects stand had no influence on where they are, which the result shows at once."""
        from ..result.kept_ground import CLASSES_OF_POINTS, UNREAD_STANDING

        result = self.result
        if result is None or not isinstance(result.data, bpy.types.Mesh):
            return records
        uids, unread = (list(result.data.get(name, ())) for name in (CLASSES_OF_POINTS, UNREAD_STANDING))
        known = {str(uid): level for uid, level in zip(uids, unread, strict=False)}
        return tuple(settings_record.without_unread(one, known) for one in records)

    def stands_on_whole(self) -> bool | None:
        """Return whether the last run took the whole surface, if another one would do as it did; None where nobody knows."""
        from ..result.kept_ground import ON_WHOLE

        result = self.result_in(self.id_data)
        if result is None or not isinstance(result.data, bpy.types.Mesh) or ON_WHOLE not in result.data:
            return None
        return bool(result.data[ON_WHOLE]) if settings_record.same_surface(self._ran_with_record(), self) else None

    def only_counts_changed(self, now: dict) -> bool:
        """Tell whether nothing but counts and classes differ from what the last run was made with; ``now`` is the record of now."""
        before = self._ran_with_record()
        return bool(before) and settings_record.only_counts_differ(before, now)

    def ran_with_class(self, body_class: ESH_PG_class) -> bool:
        """Tell whether a class took part in the last run."""
        return bool(self.report_json) and str(body_class.uid) in _parse_record(self.ran_with).get("classes", {})

    def names_in_report(self) -> list[str]:
        """Return the names of the report's classes, as they are called now."""
        from ..result.kept_ground import CLASSES_OF_POINTS

        entries = (self.report or {}).get("classes", [])
        result = self.result
        uids = (
            list(result.data.get(CLASSES_OF_POINTS, ())) if result and isinstance(result.data, bpy.types.Mesh) else []
        )
        now = {body_class.uid: body_class.name for body_class in self.classes}
        if len(uids) != len(entries):
            return [entry["name"] for entry in entries]
        return [now.get(uid, entry["name"]) for uid, entry in zip(uids, entries, strict=True)]

    def add_class(self) -> ESH_PG_class:
        """Append a class with one size, select it and return it."""
        body_class = self.classes.add()
        body_class.name = unused_name(NEW_CLASS, {other.name for other in self.classes[:-1]})
        self.give_uid(body_class)
        used = [tuple(other.color) for other in self.classes[:-1]]
        free = [color for color in CLASS_COLORS if not any(_close(color, other) for other in used)]
        body_class.color = free[0] if free else CLASS_COLORS[len(used) % len(CLASS_COLORS)]
        body_class.add_size()
        self.class_index = len(self.classes) - 1
        return body_class

    def own_uid(self) -> int:
        """Return the number that no other scatter of its scene has, and that it is known by wherever it stands; give it one first."""
        if not self.uid:
            taken = {0, *(other.uid for other in self.id_data.esh_scatter.scatters)}
            self.uid = next(uid for _ in range(1000) if (uid := random.getrandbits(30)) not in taken)
        return int(self.uid)

    def give_uid(self, body_class: ESH_PG_class) -> None:
        """Give a class a number that no other class of this scatter has, by which results know it."""
        taken = {0, *(other.uid for other in self.classes)}
        body_class.uid = next(uid for _ in range(1000) if (uid := random.getrandbits(30)) not in taken)

    def remove_class(self, index: int) -> None:
        """Remove a class, also from what others may overlap."""
        name = self.classes[index].name
        self.classes.remove(index)
        for other in self.classes:
            if name in other.names_that_may_overlap:
                other.may_overlap = joined_names(other.names_that_may_overlap - {name})
        self.class_index = max(0, min(self.class_index, len(self.classes) - 1))

    def result_in(self, scene: bpy.types.Scene) -> bpy.types.Object | None:
        """Return the last run's object where it still is in ``scene``, and in no other.

        An object that was deleted in the viewport stays in the file as long as something points to it. The settings of a linked copy
        of a scene point to the result of the other scene.
        """
        from ..result.result import is_shared
        from ..targets.target import is_result

        result = self.result
        if result is None or not is_in(scene, result) or is_shared(result) or not is_result(result):
            return None
        return result

    def obstacle(self, scene: bpy.types.Scene) -> str | None:
        """Return what keeps this from being scattered, as one sentence that says what to do, or None."""
        if obstacle := self.target_obstacle(scene):
            return obstacle
        if self.result is not None and self.result == self.chosen_target:
            return "The target is the result of the last run; choose another target"
        if obstacle := self._top_obstacle():
            return obstacle
        if not self.classes:
            return "Add a class: what to scatter"
        with asked_once():
            if self.ready_classes():
                return None
            incomplete = (self.obstacle_of(c) for c in self.classes if not c.mute)
            return next(incomplete, None) or "All classes are muted; unmute one"

    def _top_obstacle(self) -> str | None:
        """Return that the target has no top and what to do about it, as one sentence, where objects are to stand on what has one."""
        from ..result.refused import NOT_SEEN
        from ..targets.top import have_no_top

        return (
            NOT_SEEN
            if self.surface == "ABOVE" and not self.both_sides and have_no_top(self.targets_with_faces())
            else None
        )

    def obstacle_of(self, body_class: ESH_PG_class, followed_by: tuple[int, ...] = ()) -> str | None:
        """Return what keeps a class from being scattered, as one sentence, or None; one target has to have what it asks for.

        Args:
            body_class: The class.
            followed_by: The classes that follow it, and what these are followed by, by their numbers.
        """
        with asked_once() as known:
            # Whether a class is left out does not depend on which ones follow it, but what is said of it does.
            key = body_class.as_pointer(), bool(followed_by)
            if key not in known:
                known[key] = self._obstacle_of(body_class, followed_by)
            return known[key]

    def _obstacle_of(self, body_class: ESH_PG_class, followed_by: tuple[int, ...]) -> str | None:
        found = [body_class.obstacle(item) for item in self.targets]
        if None not in found:
            return next(iter(found), None)
        chain = (*followed_by, body_class.uid)
        for layer in body_class.layers:
            other = layer.other_class if layer.use and layer.kind == "CLASS" else None
            if other is None:
                continue
            if any(back.kind == "CLASS" and back.use and back.class_uid in chain for back in other.layers):
                return f'Class "{body_class.name}": it and "{other.name}" follow each other; have one follow something else'
            if other.uid not in chain and self.obstacle_of(other, chain):
                return f'Class "{body_class.name}": it follows "{other.name}", which is left out'
        return None

    def ready_classes(self) -> list[ESH_PG_class]:
        """Return the classes that can be scattered and are not muted."""
        with asked_once():
            return [c for c in self.classes if not c.mute and self.obstacle_of(c) is None]

    def left_out(self) -> list[str]:
        """Return why classes that are not muted, obstacles and targets of a collection do not count, one sentence for each."""
        with asked_once():
            why = [(c.name, self.obstacle_of(c)) for c in self.classes if not c.mute]
        gone = [(one.source.name, one.gone.rpartition('" ')[2]) for one in self.obstacles if one.use and one.gone]
        bare = self.bare_targets() if self.target_kind == "COLLECTION" else []
        return [
            *(f"{name} is left out: {text.partition(': ')[2]}" for name, text in why if text),
            *(f"{name} is left out: it {text}; choose something else to avoid" for name, text in gone),
            *(f'"{item.name}" is left out: it has no faces to stand on' for item in bare),
        ]

    def muted(self) -> str:
        """Return, as a sentence, which classes are muted, and so not placed; empty where none is."""
        names = [body_class.name for body_class in self.classes if body_class.mute]
        if len(names) < 2:
            return f"{names[0]} is muted" if names else ""
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        return f"{len(names)} classes are muted: {', '.join(names[:3])}{more}"

    def arguments(self, scene: bpy.types.Scene) -> tuple[tuple, dict]:
        """Return the positional and keyword arguments of :func:`~esh.scatter` that these settings stand for.

        Classes that are muted, or that something is missing of, are left out.
        """
        return (self.chosen_target, [body_class.as_argument() for body_class in self.ready_classes()]), {
            **values_from(self, ScatterSettings, BY_HAND),
            "non_overlap": self.non_overlap(),
            "name": self.name,
            "result": self.result_in(scene),
            "obstacles": [
                *(one.as_argument() for one in self.obstacles if one.ready),
                *(one.as_argument() for one in self.free_places),
                *self.other_results(),
            ],
            "pinned": self.classes_of_result(scene),
        }

    def classes_of_result(self, scene: bpy.types.Scene) -> list[int | None]:
        """Return, by class of the result, which of the classes that are ready it is now; None where it is none of them."""
        from ..result.kept_ground import CLASSES_OF_POINTS

        result = self.result_in(scene)
        now = {body_class.uid: number for number, body_class in enumerate(self.ready_classes())}
        return [now.get(uid) for uid in result.data.get(CLASSES_OF_POINTS, ())] if result is not None else []

    def too_many(self, granted: int = 0) -> str:
        """Return, as a sentence, what the next run takes if it is to be asked about first; empty where it is not.

        Args:
            granted: As many as that need no asking.
        """
        from .amount_ahead import question

        count = self.bodies_ahead()
        return question(self, count) if count >= self.cap and count > granted else ""

    def bodies_ahead(self) -> int:
        """Return how many objects the next run will place, about."""
        from .amount_ahead import bodies_ahead

        return bodies_ahead(self)

    def lost_by_hand(self, scene: bpy.types.Scene) -> str:
        """Return, as a sentence, which objects were moved or pinned that the next run does not keep; empty where there are none.

        Their class is left out, or another target is chosen, and they are not on it.
        """
        from ..result.pinned_bodies import lost_with_classes, lost_with_target
        from ..result.result import CLASS_NAMES

        result = self.result_in(scene)
        if result is None or result.type != "MESH":
            return ""
        if result.get(RESULT_TARGET) != self.chosen_target and (total := lost_with_target(result, self.targets)):
            return f"{total:,} moved or pinned object{'s' * (total > 1)} will be lost: the new target is elsewhere"
        sizes = [[size.name for size in c.sizes] for c in self.ready_classes()]
        lost = lost_with_classes(result, str(result.get(CLASS_NAMES, "")), sizes, self.classes_of_result(scene))
        total = sum(lost.values())
        return f"{total:,} moved or pinned object{'s' * (total > 1)} of {', '.join(lost)} will be lost" if total else ""

    def non_overlap(self) -> list[list[float]] | None:
        """Return which classes must keep apart as :func:`~esh.scatter` takes it; None where all must."""
        ready = self.ready_classes()
        apart = [
            [1.0 if i == j or not one.overlaps_with(two) else 0.0 for j, two in enumerate(ready)]
            for i, one in enumerate(ready)
        ]
        return None if all(all(row) for row in apart) else apart

    def remember(self, result: bpy.types.Object, report: dict, ran_with: str | None = None) -> None:
        """Keep what a run made and reached; ``ran_with`` is the fingerprint that it began with, None that of now."""
        from ..result.display import begin_with_points
        from ..result.kept_ground import CLASSES_OF_POINTS

        few = self.result != result or words.placed(self.report) <= self.points_above
        if few and words.placed(report) > self.points_above:
            begin_with_points(result)
        if self.result == result and result.library is None:
            take_name_of_result(self, result)
        self.result = result
        # Which objects overlap, the points say. Whether they may, and stand in clumps, only the settings that it was made with.
        kept = {
            name: value for name, value in words.kept(report).items() if name not in ("overlapping", "leaning_bodies")
        }
        kept[words.MAY_OVERLAP] = not self.avoid_overlap
        kept[words.CLUMPED] = any(body_class.clustering > 0.0 for body_class in self.ready_classes())
        self.report_json = json.dumps(kept)
        if ran_with is None:
            with checksums.now():
                ran_with = self.fingerprint()
        self.ran_with = ran_with
        keep_settings(self, result)
        remember_placed(self)
        ready = self.ready_classes()
        if isinstance(result.data, bpy.types.Mesh):
            placed = [int(uid) for uid in _parse_record(ran_with).get("classes", {})]
            result.data[CLASSES_OF_POINTS] = placed or [body_class.uid for body_class in ready]
        for body_class in ready:
            if not (body_class.show_viewport and body_class.show_render):
                show_class_anew(body_class, None)

    def as_written(self, made_with: str) -> str:
        """Return the fingerprint that a run began with as that of the result that it has written."""
        return self.fingerprint(settings_record.with_pins_of(self, json.loads(made_with)))

    def shows_at_once(self, before: dict, now: dict) -> bool:
        """Have the result show what differs between two records, if nothing has to be solved for that; tell whether it shows it.

        That is how objects stand, where it has no influence on where they are; and where the objects are that they look at.
        """
        differ = not settings_record.same(before, now)
        if differ and before["names"] == now["names"] and settings_record.same(*self._read_by_solver(before, now)):
            return True
        if not settings_record.only_looks_differ(before, now):
            return False
        for body_class in self.ready_classes():
            if settings_record.looks_of(body_class) is not None:
                stand_class_anew(body_class, None)
        return True

    def has_other_border(self, now: dict) -> bool:
        """Tell whether the result stands at another kind of border than the :meth:`record` of now asks for."""
        before = self._ran_with_record()
        return bool(before) and before["scatter"].get("boundary") != now["scatter"].get("boundary")

    def remember_look(self, body_class: ESH_PG_class) -> None:
        """Keep that the result shows where a class looks now."""
        record = _parse_record(self.ran_with)
        uid = str(body_class.uid)
        if uid in record.get("classes", {}):
            looks, kept = settings_record.looks_of(body_class), record["classes"][uid]
            if kept.get("looks") != looks:
                kept = {name: value for name, value in kept.items() if name != "looks"}
                changed = {**record["classes"], uid: kept if looks is None else {**kept, "looks": looks}}
                self.ran_with = json.dumps({**record, "classes": changed}, separators=(",", ":"))

    def remember_variants(self, body_class: ESH_PG_class, size: int) -> None:
        """Keep that the result shows the objects of a size as often as it says now."""
        told = {"variants": [list(entry) for entry in sorted(body_class.sizes[size].weights.items())]}
        self._remember_of_size(str(body_class.uid), size, ("variants",), told, {})

    def remember_sources(self, body_class: ESH_PG_class, size: int) -> None:
        """Keep that the result shows what a size places now."""
        uid = str(body_class.uid)
        with checksums.now():
            now = self.record()
        self._remember_of_size(uid, size, SOURCES, now["classes"][uid]["sizes"][size], now["names"])
        remember_placed(self, (body_class.uid, size))

    def _remember_of_size(self, uid: str, size: int, shown: tuple[str, ...], told: dict, names: dict) -> None:
        """Keep some values of a size, of which the result shows ``shown`` now, and what these name."""
        record = _parse_record(self.ran_with)
        sizes = list(record.get("classes", {}).get(uid, {}).get("sizes", []))
        if size < len(sizes):
            left = {name: value for name, value in sizes[size].items() if name not in shown}
            sizes[size] = left | {name: value for name, value in told.items() if name in shown and value}
            classes = {**record["classes"], uid: {**record["classes"][uid], "sizes": sizes}}
            keys = [f"{uid}.{size}.{name}" for name in shown]
            named = {**record["names"], **{key: names[key] for key in keys if key in names}}
            self.ran_with = json.dumps({**record, "classes": classes, "names": named}, separators=(",", ":"))

    @contextmanager
    def keeps_shapes(self) -> Iterator[None]:
        """Within a ``with`` block, targets have no other shape: what modifiers make of them then differs by rounding.

        Subdivision rounds otherwise where a mesh has a UV map.
        """
        with checksums.now():
            record = self._ran_with_record()
            kept = bool(record) and record["target"] == settings_record.state_of_targets(self)
            yield
            if kept:
                now = {**record, "target": settings_record.state_of_targets(self)}
                self.ran_with = json.dumps(now, separators=(",", ":"))

    def forget_deleted_result(self) -> None:
        """Remove a result that was deleted in the viewport from the file, so that the next one can have its name."""
        result = self.result
        if result is not None and not in_a_scene(result) and result.library is None:
            from ..result.result import remove_result

            remove_result(result)

    def _ran_with_record(self) -> dict:
        return settings_record.completed(_parse_record(self.ran_with), self)

    def record(self) -> dict:
        """Return every setting that changes the result, and what the things hold that it names, ready for JSON."""
        ready = self.ready_classes() if self.targets else []
        # As it is after it was written and read, so that it can be compared.
        return json.loads(json.dumps(settings_record.record(self, ready)))

    def fingerprint(self, now: dict | None = None) -> str:
        """Return :meth:`record` as JSON; ``now`` is that record, where it has been made."""
        return json.dumps(now or self.record(), separators=(",", ":"))


def _close(color: tuple, other: tuple) -> bool:
    return all(abs(a - b) < 1e-3 for a, b in zip(color, other, strict=True))


@lru_cache(maxsize=32)
def _parse_report(text: str) -> dict | None:
    try:
        return json.loads(text) if text else None
    except json.JSONDecodeError:  # written by hand, or by another version: as good as none
        return None


@lru_cache(maxsize=32)
def _parse_record(text: str) -> dict:
    try:
        found = json.loads(text)
    except json.JSONDecodeError:  # by another version
        return {}
    # Those of earlier versions have no names.
    return found if isinstance(found, dict) and "names" in found else {}


CLASSES = (ESH_PG_scatter,)
