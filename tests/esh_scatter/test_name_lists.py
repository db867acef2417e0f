"""Lists of names in one text come back as they were, whatever the names hold."""

import pytest

pytest.importorskip("bpy")

from esh.esh_scatter.classes.name_lists import joined_names, names_in
from hypothesis import given
from hypothesis import strategies as st

NAMES = st.text(st.characters(exclude_categories=("C", "Z")) | st.just(" "), min_size=1).filter(
    lambda s: s == s.strip()
)


@given(st.sets(NAMES))
def test_names_come_back(names):
    assert names_in(joined_names(names)) == names


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("", set()),
        ("Pine", {"Pine"}),
        ("Pine, Beech ,Log,", {"Pine", "Beech", "Log"}),
        ('"Oak, red", Pine', {"Oak, red", "Pine"}),
        ('6" nail, Pine', {'6" nail', "Pine"}),
        ('"Pine', {'"Pine'}),
        ('"Big" rock, Pine', {'"Big" rock', "Pine"}),
        ("Old\rtree, Pine", {"Old\rtree", "Pine"}),
    ],
)
def test_what_somebody_has_typed_is_read(text, names):
    assert names_in(text) == names
