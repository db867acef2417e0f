"""What the experiments of the paper ask for is what they are about."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("PIL")
pytest.importorskip("skimage")


@pytest.fixture
def figures_of_sizes(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    import figures_of_sizes

    return figures_of_sizes


def test_dark_grays_get_the_dots_that_they_ask_for_where_not_all_of_them_fit(figures_of_sizes):
    corrected, plain = (figures_of_sizes.gray_patch(1.0 - 10 / 255, correction) for correction in (True, False))
    assert corrected.avoid_overlap and plain.avoid_overlap
    assert plain.body_count == round(72 * 72 * (1.0 - 10 / 255))
    assert corrected.body_count > 1.03 * plain.body_count
