"""The data set: masks, depth, boxes and scene say the same."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

bpy = pytest.importorskip("bpy")
SCENES = Path(__file__).parents[2] / "demo_scenes"
SIZE = (160, 120)


@pytest.fixture(scope="module")
def dataset():
    sys.path.insert(0, str(SCENES))
    try:
        yield importlib.import_module("dataset")
    finally:
        sys.path.remove(str(SCENES))
        for name in ("dataset", "scene_parts"):
            sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def folder(dataset, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    words = ["--scenes", "2", "--output", str(folder), "--size", "160", "120", "--samples", "1", "--device", "cpu"]
    assert dataset.main(words) == 0
    return folder


def read(folder: Path, kind: str, number: int) -> np.ndarray:
    path = folder / kind / f"{number:06d}"
    return np.load(path.with_suffix(".npy")) if kind == "depth" else np.array(Image.open(path.with_suffix(".png")))


def test_every_scene_has_its_files(folder):
    for number in range(2):
        picture = read(folder, "images", number)
        assert picture.shape[:2] == SIZE[::-1] and picture.std() > 5.0
        assert {read(folder, kind, number).shape for kind in ("instances", "classes", "depth")} == {SIZE[::-1]}
    assert not np.array_equal(read(folder, "images", 0), read(folder, "images", 1))


def test_coco_says_what_the_masks_show(folder):
    content = json.loads((folder / "coco.json").read_text())
    assert [entry["name"] for entry in content["categories"]] == ["stone", "mushroom", "stick"]
    assert [entry["id"] for entry in content["annotations"]] == list(range(1, len(content["annotations"]) + 1))
    seen = set()
    for entry in content["annotations"]:
        instance, kind = (read(folder, name, entry["image_id"]) for name in ("instances", "classes"))
        height, width = entry["segmentation"]["size"]
        runs = entry["segmentation"]["counts"]
        flat = np.repeat(np.arange(len(runs)) % 2 == 1, runs)
        mask = flat.reshape(width, height).T
        np.testing.assert_array_equal(mask, instance == entry["instance"])
        assert mask.sum() == entry["area"] > 0
        assert set(kind[mask].tolist()) == {entry["category_id"]}
        x, y, w, h = entry["bbox"]
        inside = mask[y : y + h, x : x + w]
        assert inside.sum() == entry["area"]
        assert inside[0].any() and inside[-1].any() and inside[:, 0].any() and inside[:, -1].any()
        seen.add(entry["category_id"])
    assert seen == {1, 2, 3}
    for number in range(2):
        shown = {e["instance"] for e in content["annotations"] if e["image_id"] == number}
        assert shown == set(np.unique(read(folder, "instances", number)).tolist()) - {0}


def test_masks_and_depth_are_those_of_the_scene(dataset, folder):
    result = dataset.build(1, device="cpu")
    mesh = result.object.data
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    bpy.context.view_layer.update()
    instance, kind, depth = (read(folder, name, 1) for name in ("instances", "classes", "depth"))
    classes = result.placement.class_index
    shown = np.unique(instance[instance > 0])
    assert len(shown) > 10
    for number in shown:
        assert set(kind[instance == number].tolist()) == {classes[number - 1] + 1}

    # Rays of Blender's own through the middle of pixels meet the same at the same depth.
    camera = scene.camera
    graph = bpy.context.evaluated_depsgraph_get()
    frame = [camera.matrix_world @ corner for corner in camera.data.view_frame(scene=scene)]
    right, lower = frame[0] - frame[3], frame[2] - frame[3]
    back = camera.matrix_world.col[2].xyz
    eye = camera.matrix_world.translation
    agreed, tried = 0, 0
    for row in range(2, SIZE[1], 12):
        for column in range(2, SIZE[0], 12):
            aim = frame[3] + right * ((column + 0.5) / SIZE[0]) + lower * ((row + 0.5) / SIZE[1])
            hit, place, *_ = scene.ray_cast(graph, eye, (aim - eye).normalized())
            tried += 1
            if not hit:
                agreed += bool(np.isinf(depth[row, column]))
            else:
                agreed += abs((eye - place).dot(back) - depth[row, column]) < 0.02
    assert tried > 100 and agreed > 0.97 * tried
    assert len(mesh.vertices) == len(classes)


def test_scenes_that_are_there_are_not_made_again(dataset, folder, monkeypatch):
    times = {path: path.stat().st_mtime_ns for path in folder.glob("images/*")}
    monkeypatch.setattr(dataset, "write_scene", lambda *_, **__: pytest.fail("it is there"))
    assert dataset.main(["--scenes", "2", "--output", str(folder)]) == 0
    assert {path: path.stat().st_mtime_ns for path in folder.glob("images/*")} == times


@pytest.mark.parametrize("number", [0, 1])
def test_depth_and_camera_say_where_everything_is(folder, number):
    camera = json.loads((folder / "scenes" / f"{number:06d}.json").read_text())["camera"]
    depth, instance = read(folder, "depth", number).astype(np.float64), read(folder, "instances", number)
    row, column = np.nonzero(np.isfinite(depth))
    pixel = np.stack([column + 0.5, row + 0.5, np.ones(len(row))])
    seen = np.linalg.inv(camera["intrinsics"]) @ pixel * depth[row, column]
    place = np.linalg.inv(camera["from_world"]) @ np.concatenate([seen, np.ones((1, len(row)))])
    ground = instance[row, column] == 0
    # The ground lies at 0, inside its edges; what stands on it is higher.
    assert ground.sum() > 1000 and np.abs(place[2, ground]).max() < 1e-3
    assert (np.abs(place[:2, ground]) <= [[4.5 + 1e-3], [3.5 + 1e-3]]).all()
    assert place[2, ~ground].min() > -1e-3 and 0.05 < np.median(place[2, ~ground]) < 1.0
