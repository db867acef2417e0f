"""What Live makes and changes between undo steps, which know nothing of it: undo may keep what it changed, and frees what it made."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import bpy

from ..classes.node_tree import parts_of
from ..result.display import our_modifier
from ..result.replaced_data import Owned, Replaced, owned_by
from ..targets.references import Reference
from .new_result import Kept, NewResult, Scatter

if TYPE_CHECKING:
    from ..result.emptied_group import EmptiedGroup

__all__ = ["Before", "forget", "forget_known", "go_back", "is_any_noted", "note", "went_back"]

# Node groups with parts that no undo step may know of yet, by their numbers, whoever uses them now; and those emptied for an undo.
_built: dict[int, Reference] = {}
_emptied: list[EmptiedGroup] = []
# Results that have another mesh or group than the last step knows, because copies use the ones that they had.
_replaced: dict[int, Replaced] = {}
# Results that the last step may not know.
_made: dict[int, NewResult] = {}
# How much memory all steps took when something was noted last [bytes].
_taken = 0


class Before(NamedTuple):
    """What there is of a scatter before its placement is shown."""

    groups: set[int]
    owned: Owned | None
    kept: Kept
    others: set[bpy.types.Object]

    @classmethod
    def by(cls, scatter: Scatter, scene: bpy.types.Scene) -> Before:
        """Return what there is now."""
        result = scatter.result
        owned = None if result is None else owned_by(result)
        others = set() if scatter.result_in(scene) else set(scene.objects)
        return cls(_groups_of(result), owned, Kept.by(scatter), others)


def note(
    before: Before,
    scatter: Scatter,
    result: bpy.types.Object,
    scatter_of: Callable[[bpy.types.Scene | None, int], Scatter | None],
) -> None:
    """Note what is other than before in what shows a placement.

    Args:
        before: What there was.
        scatter: The scatter, which does not keep the result yet.
        result: What shows its placement.
        scatter_of: Finds a scatter of a scene by its number.
    """
    if result != scatter.result and result not in before.others:
        _made[result.session_uid] = NewResult(scatter, result, before.kept, scatter_of)
    modifier = our_modifier(result)
    if modifier is not None and _groups_of(result) != before.groups:
        _built[modifier.node_group.session_uid] = Reference(modifier.node_group, "group")
    if before.owned is not None and result == scatter.result and not owned_by(result).is_same(before.owned):
        _replaced.setdefault(result.session_uid, Replaced(result)).add(before.owned)
    _look_at_steps()


def go_back() -> None:
    """Before undo and redo: nothing that stays may lead to what these free."""
    from ..result.emptied_group import empty_group

    groups = {uid: reference.find() for uid, reference in _built.items()}
    for uid, group in groups.items():
        if group is None:
            _built.pop(uid)
        else:
            _emptied.append(empty_group(group))
    for replaced in _replaced.values():
        replaced.put_back()
    for made in _made.values():
        made.take_out()


def went_back() -> None:
    """After undo and redo: what these have left is there again."""
    from ..result.emptied_group import fill_group

    for uid in [uid for uid, replaced in _replaced.items() if not replaced.take_again()]:
        _replaced.pop(uid)
    for emptied in _emptied:
        fill_group(emptied)
    _emptied.clear()
    for uid in [uid for uid, made in _made.items() if not made.put_again()]:
        _made.pop(uid)
    _look_at_steps()


def forget() -> None:
    """Forget everything: another file is opened, or the extension ends."""
    for noted in (_built, _replaced, _made):
        noted.clear()


def forget_known() -> None:
    """Forget everything once there was another step since, which holds it: from there on Blender goes back and forth by itself.

    What is noted has made something new, so any step is preceded by one of the whole file. Blender 4.5 does not tell of steps.
    """
    if _memory_of_steps() != _taken:
        forget()


def _look_at_steps() -> None:
    """Know from now on whether there is another step."""
    global _taken
    _taken = _memory_of_steps()


def _memory_of_steps() -> int:
    return int(bpy.app.memory_usage_undo()) if hasattr(bpy.app, "memory_usage_undo") else 0


def is_any_noted() -> bool:
    """Tell whether undo has to be listened to."""
    return bool(_built or _replaced or _made)


def _groups_of(result: bpy.types.Object | None) -> set[int]:
    """Return the numbers of a result's node group and of its parts."""
    modifier = None if result is None else our_modifier(result)
    return set() if modifier is None else {g.session_uid for g in (modifier.node_group, *parts_of(modifier.node_group))}
