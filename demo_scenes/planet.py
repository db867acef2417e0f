"""A planet of trees: ten million of them on the land of the Earth, solved in tiles, and a picture from orbit down to one tree.

    python demo_scenes/planet.py --output output            # needs: pip install 'esh-scatter[planet]'
    python demo_scenes/planet.py --output output --quick    # 20,000 trees

The land is real: a mask of one kilometer, of NOAA's elevation model GLOBE, from the package global-land-mask (MIT license). Which
trees grow is not: three belts by latitude alone. The domain is the Mercator map, which keeps angles; so what is even on the map, for
a density that takes its scale into account, is even on the globe.

    planet/world.toml    the recipe, with a density for each kind of tree (.npy)
    planet/tiles/        the trees: GeoParquet in Web Mercator meters (EPSG:3857)
    planet.jpg           the picture
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import esh
import numpy as np
from PIL import Image, ImageDraw

__all__ = ["build", "draw", "main", "write_world"]

# Land of latitudes and longitudes [degrees], arrays of one shape.
Land = Callable[[np.ndarray, np.ndarray], np.ndarray]

# Radius of the sphere of Web Mercator [m].
RADIUS = 6_378_137.0
# Latitudes between which trees grow.
SOUTH, NORTH = -56.0, 72.0
# Kind of tree -> share of all, latitude and width of its belt [degrees], whether it grows south of the equator as well, color.
KINDS = {
    "conifer": (0.36, 57.0, 9.0, False, (26, 74, 62)),
    "broadleaf": (0.24, 44.0, 9.0, True, (104, 128, 40)),
    "tropical": (0.40, 0.0, 13.0, True, (22, 110, 46)),
}
# Of every kind, so many are large; and how much larger their area is.
LARGE_SHARE, LARGER = 0.2, 4.0
SEA, GROUND, SPACE = (18, 46, 84), (196, 178, 132), (6, 8, 14)
# Widths of the pictures [km], the place that they lead to (in the Black Forest), and their pixels.
WIDTHS = (13_400.0, 2_600.0, 420.0, 64.0, 9.0)
FOCUS = (48.3, 8.2)
PIXELS = 640
GAP = 8


def mercator(latitude: float) -> float:
    """Distance of a latitude from the equator on the map [m]."""
    return RADIUS * math.log(math.tan(0.25 * math.pi + 0.5 * math.radians(latitude)))


def earth() -> Land:
    """The land of the Earth."""
    try:
        from global_land_mask import globe
    except ImportError:
        raise SystemExit("the planet needs a mask of the land: pip install 'esh-scatter[planet]'") from None
    return globe.is_land


def write_world(folder: Path, trees: int, columns: int, land: Land) -> Path:
    """Write densities and recipe; returns the recipe.

    Args:
        folder: Where to.
        trees: Number of trees.
        columns: Pixels round the equator.
        land: Where there is land.
    """
    folder.mkdir(parents=True, exist_ok=True)
    low, high = mercator(SOUTH), mercator(NORTH)
    width = 2.0 * math.pi * RADIUS
    pixel = width / columns
    rows = round((high - low) / pixel)
    longitude = (np.arange(columns) + 0.5) / columns * 360.0 - 180.0
    names = {kind: f"{kind}.npy" for kind in KINDS}
    images = {
        kind: np.lib.format.open_memmap(folder / name, mode="w+", dtype=np.uint8, shape=(rows, columns))
        for kind, name in names.items()
    }
    latitudes = np.degrees(2.0 * np.arctan(np.exp((high - (np.arange(rows) + 0.5) * (high - low) / rows) / RADIUS)))
    latitudes -= 90.0
    for row, latitude in enumerate(latitudes.tolist()):
        there = land(np.full(columns, latitude), longitude)
        # A square meter of the map is less of the globe, the farther from the equator.
        scale = math.cos(math.radians(latitude)) ** 2
        for kind, (_, belt, wide, both, _) in KINDS.items():
            away = (abs(latitude) if both else latitude) - belt
            images[kind][row] = np.where(there, round(255.0 * scale * math.exp(-((away / wide) ** 2))), 0)
    for image in images.values():
        image.flush()
    lines = ["version = 1", "seed = 8", "[domain]", f"size = [{width!r}, {high - low!r}]"]
    ground = 0.25 * width * (high - low) / trees
    for kind, (share, *_) in KINDS.items():
        count = round(share * trees)
        large = max(1, round(LARGE_SHARE * count))
        lines += ["[[class]]", f'name = "{kind}"', f'density = "{names[kind]}"']
        for size, area, number in (("large", LARGER * ground, large), ("small", ground, count - large)):
            lines += ["[[class.size]]", f'name = "{size}"', f"area = {area!r}", f"count = {number}"]
        # The middle of the first pixel: coordinates are those of the map.
        place = (pixel, 0.0, 0.0, -(high - low) / rows, -0.5 * width + 0.5 * pixel, high - 0.5 * (high - low) / rows)
        (folder / f"{names[kind]}w").write_text("".join(f"{number!r}\n" for number in place), encoding="ascii")
    recipe = folder / "world.toml"
    recipe.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return recipe


class Trees:
    """The trees in a folder of tiles."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.index = json.loads((folder / "index.json").read_text(encoding="utf-8"))

    def near(self, latitude: float, longitude: float, reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Latitudes, longitudes [degrees] and kinds of all trees, and of those in tiles that come nearer than ``reach`` [m]."""
        import pyarrow.parquet as parquet

        here = direction(np.array([latitude]), np.array([longitude]))[0]
        parts = []
        for tile in self.index["tiles"]:
            if reach < RADIUS and not self._comes_near(tile, here, reach):
                continue
            table = parquet.read_table(self.folder / tile["file"], columns=["geometry", "class_index", "size_index"])
            x, y = (part.to_numpy() for part in table["geometry"].combine_chunks().flatten())
            kind = table["class_index"].to_numpy() * 2 + table["size_index"].to_numpy()
            parts.append((*unmapped(x, y), kind))
        latitude_of, longitude_of, kind_of = (np.concatenate(column) for column in zip(*parts, strict=True))
        return latitude_of, longitude_of, kind_of

    def _comes_near(self, tile: dict, here: np.ndarray, reach: float) -> bool:
        # On a few points of the tile, and by how far these are apart.
        share = np.linspace(0.0, 1.0, 5)
        x = tile["low"][0] + share * (tile["high"][0] - tile["low"][0])
        y = tile["low"][1] + share * (tile["high"][1] - tile["low"][1])
        latitude, longitude = unmapped(*(grid.ravel() for grid in np.meshgrid(x, y)))
        points = direction(latitude, longitude)
        away = RADIUS * np.arccos(np.clip(points @ here, -1.0, 1.0))
        apart = (tile["high"][0] - tile["low"][0]) / 4.0
        return bool(away.min() < reach + apart)


def unmapped(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Latitudes and longitudes [degrees] of places on the map [m]."""
    return np.degrees(2.0 * np.arctan(np.exp(y / RADIUS))) - 90.0, np.degrees(x / RADIUS)


def direction(latitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    """Unit vectors, shape ``[n, 3]``."""
    a, b = np.radians(latitude), np.radians(longitude)
    return np.stack([np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)], axis=-1)


def view_axes(latitude: float, longitude: float) -> np.ndarray:
    """East, north and up at a place, as rows."""
    a, b = math.radians(latitude), math.radians(longitude)
    east = [-math.sin(b), math.cos(b), 0.0]
    north = [-math.sin(a) * math.cos(b), -math.sin(a) * math.sin(b), math.cos(a)]
    return np.array([east, north, direction(np.array([latitude]), np.array([longitude]))[0]])


def ground_picture(axes: np.ndarray, width: float, land: Land) -> np.ndarray:
    """Land and sea from above, shape ``[PIXELS, PIXELS, 3]``, float; ``width`` in meters."""
    step = (np.arange(PIXELS) + 0.5) / PIXELS - 0.5
    x, y = np.meshgrid(step * width / RADIUS, -step * width / RADIUS)
    squared = x**2 + y**2
    on_globe = squared < 1.0
    z = np.sqrt(np.maximum(1.0 - squared, 0.0))
    point = x[..., None] * axes[0] + y[..., None] * axes[1] + z[..., None] * axes[2]
    latitude = np.degrees(np.arcsin(np.clip(point[..., 2], -1.0, 1.0)))
    longitude = np.degrees(np.arctan2(point[..., 1], point[..., 0]))
    there = np.zeros(x.shape, bool)
    there[on_globe] = land(latitude[on_globe], longitude[on_globe])
    ice = there & ((latitude > NORTH) | (latitude < SOUTH))
    color = np.where(there[..., None], np.array(GROUND, float), np.array(SEA, float))
    color[ice] = (232, 238, 242)
    # The sun stands to the left, above.
    light = np.clip(0.35 + 0.75 * (z * 0.8 - x * 0.35 + y * 0.35), 0.15, 1.1)
    curved = width > 0.3 * RADIUS
    color = color * light[..., None] if curved else color
    color[~on_globe] = SPACE
    return color


def add_trees(color: np.ndarray, axes: np.ndarray, width: float, trees: tuple[np.ndarray, ...], spacing: float) -> None:
    """Draw trees into a picture: as a haze where they are many to a pixel, or else one by one."""
    latitude, longitude, kind = trees
    point = direction(latitude, longitude) @ axes.T
    pixel = PIXELS * RADIUS / width
    x, y = point[:, 0] * pixel + 0.5 * PIXELS, 0.5 * PIXELS - point[:, 1] * pixel
    radius = 0.4 * spacing * PIXELS / width * np.where(kind % 2 == 0, 1.35, 0.85)
    reach = float(radius.max(initial=0.0))
    seen = (point[:, 2] > 0.0) & (x > -reach) & (x < PIXELS + reach) & (y > -reach) & (y < PIXELS + reach)
    x, y, kind, radius = x[seen], y[seen], kind[seen], radius[seen]
    colors = np.array([entry[-1] for entry in KINDS.values()], float)
    if reach < 1.5:
        column, row = x.astype(int).clip(0, PIXELS - 1), y.astype(int).clip(0, PIXELS - 1)
        place = row * PIXELS + column
        weight = np.pi * radius**2
        cover = np.bincount(place, weight, PIXELS**2).reshape(PIXELS, PIXELS)
        mean = (
            np.stack(
                [
                    np.bincount(place, weight * colors[kind // 2, c], PIXELS**2).reshape(PIXELS, PIXELS)
                    for c in range(3)
                ],
                -1,
            )
            / np.maximum(cover, 1e-9)[..., None]
        )
        share = 1.0 - np.exp(-1.6 * cover)[..., None]
        dim = np.clip(color.sum(axis=2, keepdims=True) / sum(GROUND), 0.2, 1.1) if width > 0.3 * RADIUS else 1.0
        color += share * (mean * dim - color)
        return
    for number in np.argsort(radius, kind="stable").tolist():
        add_tree(color, x[number], y[number], radius[number], int(kind[number]), colors[kind[number] // 2])


def add_tree(color: np.ndarray, x: float, y: float, radius: float, kind: int, shade: np.ndarray) -> None:
    """Draw a tree from above: its crown, lit from the left, and its shadow."""
    reach = math.ceil(1.5 * radius + 1.0)
    left, top = max(int(x) - reach, 0), max(int(y) - reach, 0)
    right, bottom = min(int(x) + reach + 1, PIXELS), min(int(y) + reach + 1, PIXELS)
    if left >= right or top >= bottom:
        return
    part = color[top:bottom, left:right]
    across, down = np.meshgrid(np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5)
    lobes, depth = ((11, 0.22), (7, 0.09), (9, 0.32))[kind // 2]

    def cover(dx: float, dy: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        u, v = (across - x - dx) / radius, (down - y - dy) / radius
        away = np.hypot(u, v)
        edge = 1.0 - depth * (0.5 + 0.5 * np.cos(lobes * np.arctan2(v, u) + x))
        return np.clip((edge - away) * radius + 0.5, 0.0, 1.0), u, v, away

    shadow = cover(0.18 * radius, 0.18 * radius)[0]
    part *= 1.0 - 0.45 * shadow[..., None]
    crown, u, v, away = cover(0.0, 0.0)
    # A cone for conifers, lumps for others.
    lumps = 0.12 * np.sin(9.0 * u + 3.0 * x) * np.cos(8.0 * v + 5.0 * y) * (kind // 2 > 0)
    slope = (u + v) / np.maximum(away, 1e-6) if kind // 2 == 0 else u + v
    light = np.clip(1.0 - 0.33 * slope + lumps + 0.25 * (1.0 - away), 0.3, 1.7)
    part += crown[..., None] * (np.clip(shade * light[..., None], 0, 255) - part)


def draw(path: Path, folder: Path, trees: int, land: Land) -> None:
    """Draw the trees of a folder of tiles from orbit down to one tree.

    Args:
        path: The picture, ``.jpg``.
        folder: The tiles.
        trees: How many there are.
        land: Where there is land.
    """
    planet = Trees(folder)
    focus = FOCUS
    near = planet.near(*focus, 2.0e6)
    if len(near[0]):
        # The last picture is of one tree.
        away = (near[0] - focus[0]) ** 2 + ((near[1] - focus[1]) * math.cos(math.radians(focus[0]))) ** 2
        chosen = int(np.argmin(away + 1e3 * (near[2] % 2)))
        focus = float(near[0][chosen]), float(near[1][chosen])
    # Fewer trees stand farther apart.
    wider = math.sqrt(10_000_000 / trees)
    spacing = 3_900.0 * wider
    whole = Image.new("RGB", (len(WIDTHS) * (PIXELS + GAP) - GAP, PIXELS), (255, 255, 255))
    pen = ImageDraw.Draw(whole)
    widths = [WIDTHS[0] * 1e3, *(min(width * wider, WIDTHS[0] / 2.0**k) * 1e3 for k, width in enumerate(WIDTHS[1:], 1))]
    for number, width in enumerate(widths):
        center = (min(focus[0], 24.0), focus[1] + 4.0) if number == 0 else focus
        axes = view_axes(*center)
        color = ground_picture(axes, width, land)
        add_trees(color, axes, width, planet.near(*center, 0.75 * width if number else math.inf), spacing)
        left = number * (PIXELS + GAP)
        whole.paste(Image.fromarray(np.clip(color, 0, 255).astype(np.uint8)), (left, 0))
        if number + 1 < len(widths):
            point = axes @ direction(np.array([focus[0]]), np.array([focus[1]]))[0]
            half = max(0.5 * widths[number + 1] / width * PIXELS, 4.0)
            x, y = (0.5 + point[0] * RADIUS / width) * PIXELS + left, (0.5 - point[1] * RADIUS / width) * PIXELS
            pen.rectangle((x - half, y - half, x + half, y + half), outline=(255, 255, 255), width=2)
        pen.text((left + 10, PIXELS - 20), f"{width / 1e3:,.0f} km", fill=(255, 255, 255))
    whole.save(path, quality=90)


def build(
    output: Path,
    trees: int,
    columns: int,
    land: Land,
    workers: int | None = None,
    steps: tuple[int, int, int] = (40, 30, 30),
) -> dict[str, int]:
    """Make the planet, look whether all is as it was asked for, and draw it; returns the trees of every kind."""
    start = time.perf_counter()
    folder = output / "planet"
    recipe = write_world(folder, trees, columns, land)
    print(f"densities of {columns:,} columns: {time.perf_counter() - start:.0f} s", flush=True)
    start = time.perf_counter()
    last = [0.0]

    def show(state: esh.TileState) -> None:
        if time.perf_counter() - last[0] > 10.0:
            last[0] = time.perf_counter()
            print(f"  {state.name}: {state.done:,} of {state.parts:,} windows", flush=True)

    state = esh.solve_tiles(recipe, folder / "tiles", workers=workers, steps=steps, device="cpu", progress=show)
    seconds = time.perf_counter() - start
    print(f"{state.bodies:,} trees in {state.tiles[0]} x {state.tiles[1]} tiles: {seconds:.0f} s", flush=True)
    latitude, longitude, kind = Trees(folder / "tiles").near(0.0, 0.0, math.inf)
    counted = {name: int((kind // 2 == number).sum()) for number, name in enumerate(KINDS)}
    asked = {name: round(entry[0] * trees) for name, entry in KINDS.items()}
    if counted != asked:
        raise SystemExit(f"asked for {asked}, and got {counted}")
    pixel = 360.0 / columns
    # On the pixels that they were placed on.
    snapped = (np.floor((longitude + 180.0) / pixel).clip(0, columns - 1) + 0.5) * pixel - 180.0
    wet = float((~land(latitude, snapped)).mean())
    print(f"{wet:.2%} of the trees stand in water, by half a pixel of latitude")
    draw(output / "planet.jpg", folder / "tiles", trees, land)
    print(output / "planet.jpg")
    return counted


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("output"))
    parser.add_argument("--trees", type=int, default=10_000_000)
    parser.add_argument("--columns", type=int, default=21_600, help="pixels round the equator")
    parser.add_argument("--workers", type=int, default=None)
    parser.add_argument("--quick", action="store_true", help="20,000 trees on a coarse map")
    options = parser.parse_args(arguments)
    trees, columns = (20_000, 2_160) if options.quick else (options.trees, options.columns)
    build(options.output, trees, columns, earth(), options.workers)
    return 0


if __name__ == "__main__":
    sys.exit(main())
