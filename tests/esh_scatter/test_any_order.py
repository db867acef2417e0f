"""Whatever is done in whatever order: a button does what it says or refuses in a sentence, and panels draw."""

import importlib
import os
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parent)
    walks = importlib.import_module("sidebar_walk")

pytestmark = pytest.mark.slow

# More of them: `make walk`.
SEEDS = range(int(os.environ.get("ESH_WALKS", "4")))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_walk_through_the_sidebar_ends_well(seed, tmp_path):
    walks.SidebarWalk(seed, tmp_path / "walk.blend").run(50)


def test_a_walk_tells_of_what_breaks(monkeypatch, capsys):
    from esh.esh_scatter.operators import scatters

    def broken(_self, _context):
        raise IndexError("a mistake of ours")

    for name in ("ESH_OT_scatter_add", "ESH_OT_scatter_remove"):
        monkeypatch.setattr(getattr(scatters, name), "execute", broken)
    assert walks.main(["--seconds", "60", "--steps", "400", "--only"]) == 1
    said = capsys.readouterr().out
    assert "walk 0, step " in said and "a mistake of ours" in said and said.endswith("1 walks, 1 broken\n")
