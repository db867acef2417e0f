"""The planet: every tree that was asked for, on land, in its belt, and a picture."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("pyarrow.parquet")

PATH = Path(__file__).parents[2] / "demo_scenes" / "planet.py"


@pytest.fixture(scope="module")
def planet():
    specification = importlib.util.spec_from_file_location("planet", PATH)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def continents(latitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    """Two lands: one round the place that the pictures lead to."""
    latitude, longitude = np.asarray(latitude), np.asarray(longitude)
    first = np.hypot(latitude - 45.0, longitude - 10.0) < 35.0
    return first | ((np.abs(latitude) < 30.0) & (np.abs(longitude + 60.0) < 25.0))


def test_a_small_planet(planet, tmp_path):
    counted = planet.build(tmp_path, 6_000, 720, continents, 0, (12, 8, 8))
    assert counted == {"conifer": 2160, "broadleaf": 1440, "tropical": 2400}
    latitude, longitude, kind = planet.Trees(tmp_path / "planet" / "tiles").near(0.0, 0.0, math.inf)
    # To a pixel of the map.
    near_land = np.any(
        [continents(latitude + a, longitude + b) for a in (-0.5, 0.0, 0.5) for b in (-0.5, 0.0, 0.5)], axis=0
    )
    assert near_land.all()
    belts = [np.abs(latitude[kind // 2 == number]).mean() for number in range(3)]
    assert belts[0] > belts[1] > belts[2]
    # As many to an area of the globe in all latitudes of a belt, though the map stretches them.
    tropical = latitude[(kind // 2 == 2) & (longitude < -35.0)]
    inner, outer = (np.abs(tropical) < 8.0).sum(), ((np.abs(tropical) >= 8.0) & (np.abs(tropical) < 16.0)).sum()
    band = np.linspace(0.0, 16.0, 1601)
    share = np.exp(-((band / 13.0) ** 2)) * np.cos(np.radians(band))
    assert outer / inner == pytest.approx(share[800:].sum() / share[:801].sum(), rel=0.1)
    with Image.open(tmp_path / "planet.jpg") as picture:
        assert picture.size == (5 * 640 + 4 * 8, 640)
        pixels = np.asarray(picture).reshape(640, -1, 3)
    # The globe, the sky around it, and green on the last picture.
    assert pixels[5, 5].sum() < 60 and pixels[320, 320].sum() > 60
    last = pixels[:, -640:].astype(int)
    assert (last[..., 1] > last[..., 0] + 10).mean() > 0.2


def test_the_earth_needs_its_mask(planet):
    if importlib.util.find_spec("global_land_mask") is None:
        with pytest.raises(SystemExit, match=r"esh-scatter\[planet\]"):
            planet.earth()
        return
    land = planet.earth()
    assert land(np.array([47.0, 0.0]), np.array([8.0, -30.0])).tolist() == [True, False]
