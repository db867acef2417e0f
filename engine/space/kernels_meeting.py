"""Which bodies keep apart: those of classes that may lie on each other do not."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class Meeting:
    """The class of every body; and for every two classes whether they keep apart, row by row. No ``classes``: all keep apart."""

    of_body: wp.array(dtype=wp.int32)
    apart: wp.array(dtype=wp.int32)
    classes: wp.int32


@wp.func
def keep_apart(i: int, j: int, meeting: Meeting):
    """Whether two bodies keep apart."""
    if meeting.classes == 0:
        return True
    return meeting.apart[meeting.of_body[i] * meeting.classes + meeting.of_body[j]] != 0
