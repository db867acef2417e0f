"""Which of the sidebar's settings have an influence on a result that is solved, and which it shows at once."""

from ...engine.problem.look_at import LookAt
from ...engine.problem.scatter_settings import Standing
from ...engine.problem.settings import settings_of

__all__ = ["AT_ONCE", "LOOKS", "WITHOUT_INFLUENCE"]

# Where a class looks: the switch, the object, and what describes it.
LOOKS = ("use_look_at", "look_at_object", *(f"look_at_{name}" for name in settings_of(LookAt)))
# What needs no solving: it is changed in the result at once. So is the scale, but footprints follow it.
AT_ONCE = {*settings_of(Standing), *LOOKS, "color", "show_viewport", "show_render"} - {"scale"}
# What has no influence on a result that is solved: what is changed at once, names, what the lists show, and what is known of the
# last run; of the target its shape and place have. Whatever else a group has, has.
WITHOUT_INFLUENCE = AT_ONCE | {
    "name",
    "class_index",
    "obstacle_index",
    "size_index",
    "result",
    "target",
    "live",
    # What these hold counts, which is looked into where they are chosen.
    "direction_object",
    "direction_attribute",
    "report_json",
    "ran_with",
    "uid",
    "known_name",
    "named_after",
    "waits_for_first",
    "source_was_in_scene",
    "names_class",
    "layer_index",
    "points_above",
    "cap",
}
