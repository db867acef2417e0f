"""What the README, CONTRIBUTING and the pages in docs/ show runs as it stands there, and what they link to exists."""

from __future__ import annotations

import ast
import importlib.util
import re
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import esh
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
PAGES = [README, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += sorted((ROOT / "demo_scenes").rglob("README.md"))
TEXT = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in PAGES}
WORDS = "\n".join(TEXT.values())


def blocks(language: str) -> list[tuple[str, str]]:
    """Page and text of every code block in a language, in the order of the pages."""
    return [
        (page, block)
        for page, text in TEXT.items()
        for block in re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    ]


def name_of(block: object) -> str | None:
    return block if isinstance(block, str) and block in TEXT else ""


SCRIPTS = blocks("python")
# Of other programs, which are run where these are installed: heading -> what stands under it.
FOREIGN_SCRIPTS = {
    section.partition("\n")[0]: scripts
    for section in TEXT["docs/pipelines.md"].split("\n## ")[1:]
    if (scripts := re.findall(r"^```py\n(.*?)^```$", section, re.MULTILINE | re.DOTALL))
}
RECIPES = [block for _, block in blocks("toml")]
(README_SCRIPT,) = [script for page, script in SCRIPTS if page == "README.md"]


def test_there_is_a_script_for_each_world_and_recipes_of_bodies_and_of_inks():
    assert "bpy" not in README_SCRIPT
    assert any("bpy" in script for _, script in SCRIPTS)
    assert ["[image]" in recipe for recipe in RECIPES] == [False, True, False, False]
    assert "[[obstacle]]" in RECIPES[2] and "[surface]" in RECIPES[3]


@pytest.mark.parametrize("page", TEXT)
def test_no_recipe_or_script_hides_from_the_tests(page: str):
    text = re.sub(r"^```\w+\n.*?^```$", "", TEXT[page], flags=re.MULTILINE | re.DOTALL)
    assert not re.search(r"^ *(?:\[\[class\]\]|\[domain\]|version = 1)$", text, re.MULTILINE), (
        "a recipe without a fence"
    )
    assert not re.search(r"^ *(?:import \w+$|from \w+ import )", text, re.MULTILINE), "a script without a fence"
    assert set(re.findall(r"^```([^\s{]+)", TEXT[page], re.MULTILINE)) <= {"python", "py", "toml"}


@pytest.mark.parametrize(("page", "script"), SCRIPTS, ids=name_of)
def test_a_script_runs_and_prints_its_report(page: str, script: str, tmp_path: Path):
    if "bpy" in script and importlib.util.find_spec("bpy") is None:
        pytest.skip("needs Blender as a Python module")
    outcome = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert outcome.returncode == 0, outcome.stderr
    if ".report" in script:
        assert "asked" in outcome.stdout and "placed" in outcome.stdout
    else:
        assert outcome.stdout.strip(), f"a script on {page} shows nothing"
    if "scattered.blend" in script:
        assert (tmp_path / "scattered.blend").stat().st_size > 10_000


@pytest.mark.parametrize(("page", "script"), SCRIPTS, ids=name_of)
def test_a_script_imports_what_it_uses(page: str, script: str):
    names = {alias.name for node in ast.walk(ast.parse(script)) if isinstance(node, ast.Import) for alias in node.names}
    assert "esh" in names, f"a script on {page} does not stand by itself"


def test_the_script_places_what_its_text_says():
    names: dict = {}
    exec(README_SCRIPT, names)
    placement = names["placement"]
    width = placement.problem.domain.size[0]
    mean_x = [placement.position[placement.class_index == index, 0].mean() / width for index in (0, 1)]
    # The means of densities that fall and rise linearly.
    assert np.allclose(mean_x, [1 / 3, 2 / 3], atol=0.02)
    assert placement.report.overlaps == 0
    assert np.bincount(placement.class_index).tolist() == [300, 80]


# What arrays are there as well, as the page of the command line says.
ON_A_SURFACE = {"normal", "tangent", "mesh", "triangle", "barycentric"}


def write_rock(path: Path) -> None:
    """A ball of a meter, with moss on its upper half."""
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=4)
    ball.vertex_attributes["moss"] = (ball.vertices[:, 2] > 0.1).astype(np.float32)
    ball.export(path)


def imported(script: str) -> set[str]:
    """The packages that a script imports."""
    found = set()
    for node in ast.walk(ast.parse(script)):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add((node.module or "").partition(".")[0])
    return found


# What has to be there already for the scripts of another program, and what must be true after them.
BEFORE = {
    "Infinigen": """
import bpy

bpy.ops.wm.read_homefile(use_empty=True)
bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20, size=100.0)
terrain = bpy.context.object
terrain.name = "OpaqueTerrain"
for vertex in terrain.data.vertices:
    vertex.co.z = 0.5 * vertex.co.x
bpy.ops.mesh.primitive_cone_add()
trees = bpy.data.collections.new("trees")
trees.objects.link(bpy.context.object)
""",
}
AFTER = {
    "Infinigen": """
placed_trees = [copy for copy in bpy.context.scene.objects if copy.name.startswith("Cone.")]
assert len(placed_trees) == 30
for copy in placed_trees:
    x, y, z = copy.matrix_world.translation
    assert abs(z - 0.5 * x) < 1e-3 and max(abs(x), abs(y)) < 50.001
""",
}
ON_TERRAIN = """
version = 1
[surface]
mesh = "terrain.ply"
[[class]]
name = "tree"
density = 1.0
[[class.size]]
name = "any"
area = 6.0
count = 30
"""


def test_every_script_of_another_program_is_tried():
    assert blocks("py") == [("docs/pipelines.md", script) for scripts in FOREIGN_SCRIPTS.values() for script in scripts]


@pytest.mark.parametrize("program", FOREIGN_SCRIPTS)
def test_scripts_of_other_programs_run_where_these_are_installed(program: str, tmp_path: Path):
    *before, last = FOREIGN_SCRIPTS[program]
    for script in (*before, last):
        compile(script, program, "exec")
    # What they read of a placement is what the command line writes.
    arrays = set(re.findall(r"^\| `(\w+)` \| \(", TEXT["docs/command-line.md"], re.MULTILINE))
    read = set(re.findall(r"\b(?:placed|scene)\[\"(\w+)\"\]", last))
    assert read and read <= arrays
    packages = {name for script in (*before, last) for name in imported(script)} - {"mathutils"}  # a part of bpy
    missing = [name for name in sorted(packages) if importlib.util.find_spec(name) is None]
    if missing:
        pytest.skip(f"needs {', '.join(missing)}")

    def run(*command: str) -> None:
        outcome = subprocess.run(
            [sys.executable, *command], cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False
        )
        assert outcome.returncode == 0, outcome.stderr

    for script in before:
        run("-c", BEFORE.get(program, "") + script)
    recipe = ROOT / "tests" / "recipes" / "dots-of-one-size.toml"
    if (tmp_path / "terrain.ply").exists():
        recipe = tmp_path / "trees.toml"
        recipe.write_text(ON_TERRAIN, encoding="utf-8")
    (tmp_path / "scenes" / "000000").mkdir(parents=True)
    command = ["-m", "esh.engine.cli.command_line", "solve", "-o", "scenes/000000/placement.npz"]
    run(*command, "--quiet", "--max-steps", "2", str(recipe))
    run("-c", BEFORE.get(program, "") + last + AFTER.get(program, ""), "scenes/000000")


@pytest.mark.parametrize("recipe", RECIPES, ids=["bodies", "inks", "what is there", "surface"])
def test_the_recipes_can_be_solved_as_they_stand(recipe: str, tmp_path: Path):
    image = pytest.importorskip("PIL.Image")
    (tmp_path / "recipe.toml").write_text(recipe, encoding="utf-8")
    image.fromarray(np.full((30, 40), 255, np.uint8)).save(tmp_path / "pine.png")
    image.fromarray(np.full((16, 16, 3), 200, np.uint8)).save(tmp_path / "photo.png")
    write_rock(tmp_path / "rock.ply")
    # From another folder: the image is looked for beside the recipe.
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    command = [
        sys.executable,
        "-m",
        "esh.engine.cli.command_line",
        "solve",
        str(tmp_path / "recipe.toml"),
        "-o",
        "out.npz",
    ]
    command += ["--report", "report.json", "--max-steps", "5"]
    outcome = subprocess.run(command, cwd=elsewhere, capture_output=True, text=True, timeout=600)
    assert outcome.returncode == 0, outcome.stderr
    with np.load(elsewhere / "out.npz", allow_pickle=False) as arrays:
        table = re.search(r"^\| `\.npz` array.*?(?=\n\n)", TEXT["docs/command-line.md"], re.MULTILINE | re.DOTALL)
        documented = set(re.findall(r"^\| `(\w+)` \|", table.group(), re.MULTILINE))
        # Nothing may bend here, and only one of them has fixed bodies.
        marks = set() if recipe == RECIPES[2] else {"id", "fixed", "size_name"}
        assert set(arrays) == documented - {"bends"} - marks | (ON_A_SURFACE if recipe == RECIPES[3] else set())
        if recipe == RECIPES[0]:
            pine, log = tomllib.loads(recipe)["class"]
            assert len(arrays["position"]) == pine["size"][0]["count"] + log["count"]
            assert (arrays["length"] > 0).sum() == log["count"]
        elif recipe == RECIPES[2]:
            described = tomllib.loads(recipe)
            (fixed,) = described["fixed"]
            assert arrays["position"][arrays["fixed"]].tolist() == fixed["position"]
            assert (~arrays["fixed"]).sum() == described["class"][0]["size"][0]["count"]
        elif recipe == RECIPES[3]:
            assert len(arrays["position"]) == tomllib.loads(recipe)["class"][0]["size"][0]["count"]
            assert (arrays["position"][:, 2] > 0.0).all(), "moss stands where there is none"
        else:
            # An even gray of 55 of 255 takes black dots alone.
            assert len(arrays["position"]) == round(256 * 256 * 55 / 255)


def test_the_reference_of_recipes_has_every_key():
    from esh.engine.files.recipe import PLACES

    trees = [ast.parse((ROOT / "engine" / "files" / "recipe_surface.py").read_text(encoding="utf-8"))]
    reference = TEXT["docs/recipes.md"].partition("## Every key")[2]
    documented = {name.strip("[]").split(".")[-1] for name in re.findall(r"^\| `([^`]+)` \|", reference, re.MULTILINE)}
    # Tables that stand in one line are explained there.
    inline = {"under [class.unsharp]", "under [class.look_at]", "in the command, as an option"}
    known = {key for place, keys in PLACES.items() if place not in inline for key in keys}
    for call in (node for tree in trees for node in ast.walk(tree)):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "check_keys":
            known |= {argument.value for argument in call.args if isinstance(argument, ast.Constant)}
    assert documented == known


def test_the_export_of_the_page_takes_the_objects_that_it_names(tmp_path: Path):
    usd = pytest.importorskip("pxr.Usd")
    words = re.search(r"^    esh-scatter (solve .*?)\n\n", TEXT["docs/exchange.md"], re.MULTILINE | re.DOTALL)[1]
    command = words.replace("\\\n", " ").split()
    classes = "".join(
        f'[[class]]\nname = "{name}"\ndensity = 1.0\n[[class.size]]\nname = "{size}"\narea = 1.0\ncount = 9\n'
        for name, size in (("pine", "any"), ("beech", "old"))
    )
    (tmp_path / "forest.toml").write_text(f"version = 1\n[domain]\nsize = [9.0, 9.0]\n{classes}", encoding="utf-8")
    trees = esh.BodyClass("tree", [esh.Size("only", area=1.0, count=1)])
    tree = esh.solve(esh.Problem(esh.Domain((2.0, 2.0)), [trees]), device="cpu", max_steps=1)
    assets = {word.partition("=")[2] for word in command if "=" in word}
    for asset in assets:
        esh.write_placement(tmp_path / asset, tree)
    run = [sys.executable, "-m", "esh.engine.cli.command_line", *command, "--max-steps", "1"]
    outcome = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False)
    assert outcome.returncode == 0, outcome.stderr
    stage = usd.Stage.Open(str(tmp_path / "forest.usdc"))
    used = {Path(layer.realPath).name for layer in stage.GetUsedLayers() if not layer.anonymous}
    assert used == {"forest.usdc"} | {asset for asset in assets if asset.endswith(".usdc")}


def test_the_page_of_the_command_line_has_the_columns_as_they_are_written():
    from esh.engine.files.placement_columns import COLUMNS

    table = TEXT["docs/command-line.md"].partition("| `.csv` column |")[2].partition("\n\n")[0]
    assert table.splitlines()[2:] == [
        f"| `{column.name}` | {column.unit or '–'} | {column.help} | {column.when.words} |" for column in COLUMNS
    ]


@pytest.mark.parametrize(
    ("command", "page"),
    [("solve", "command-line"), ("separate", "command-line"), ("batch", "command-line"), ("tiles", "tiles")],
)
def test_the_pages_have_every_option_of_every_command(command, page):
    outcome = subprocess.run(
        [sys.executable, "-m", "esh.engine.cli.command_line", command, "--help"], capture_output=True, text=True
    )
    options = set(re.findall(r"--[a-z-]+", outcome.stdout)) - {"--help", "--output"}
    assert options and options == {name for name in options if f"`{name}" in TEXT[f"docs/{page}.md"]}


def test_help_and_page_of_tiles_have_the_steps_that_are_taken():
    from esh.engine.tiles.tiles import STEPS

    outcome = subprocess.run(
        [sys.executable, "-m", "esh.engine.cli.command_line", "tiles", "--help"], capture_output=True, text=True
    )
    assert f"(default: {','.join(map(str, STEPS))};" in " ".join(outcome.stdout.split())
    assert f"{STEPS[0]}, {STEPS[1]} and {STEPS[2]} by default" in TEXT["docs/tiles.md"]


def test_the_reference_of_the_api_has_every_public_name():
    import esh

    directives = set(re.findall(r"^\.\. auto\w+:: esh\.(\w+)$", TEXT["docs/api.md"], re.MULTILINE))
    assert directives == set(esh.__all__)


def test_contributing_has_the_rooms_as_they_are_held():
    spec = importlib.util.spec_from_file_location("test_rooms", ROOT / "tests" / "test_rooms.py")
    rooms = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(rooms)
    table = TEXT["CONTRIBUTING.md"].partition("## The rooms")[2].partition("\n\n`errors.py`")[0]
    rows = re.findall(r"^\| `(\w+)` \|.*\| ([^|]*) \|$", table, re.MULTILINE)
    assert {room: set(re.findall(r"`(\w+)(?:\.py)?`", below)) for room, below in rows} == rooms.MAY_IMPORT
    table = TEXT["CONTRIBUTING.md"].partition("| room or file |")[2].partition("\n\n")[0]
    assert tuple(re.findall(r"^\| `(\w+)(?:/|\.py)` \|", table, re.MULTILINE)) == rooms.BLENDER_ORDER


def test_the_glossary_is_in_order_and_its_words_are_those_of_the_code():
    words = re.findall(
        r"^\| ([^|]+) \|", TEXT["CONTRIBUTING.md"].partition("| word | meaning |\n|---|---|\n")[2], re.MULTILINE
    )
    keys = [re.sub(r"[()]", "", word.lower()) for word in words]
    assert keys == sorted(set(keys)) and len(keys) > 80
    code = "\n".join(
        path.read_text(encoding="utf-8").lower()
        for room in ("engine", "esh_scatter")
        for path in (ROOT / room).rglob("*.py")
    )
    for word in words:
        for name in re.sub(r"\(.*\)", "", word).strip().split(", "):
            assert re.search(rf"\b{re.escape(name.lower())}", code), f"nothing in the code is called {name}"


def test_contributing_names_every_file_that_draws_random_numbers():
    for folder in ("engine", "esh_scatter"):
        for path in (ROOT / folder).rglob("*.py"):
            if re.search(r"default_rng\(|rand_init\(", path.read_text(encoding="utf-8")):
                assert f"`{path.relative_to(ROOT).as_posix()}`" in TEXT["CONTRIBUTING.md"]


def test_contributing_names_files_that_exist():
    for name in re.findall(r"`((?:engine|esh_scatter|tests|docs|benchmarks)/[\w./-]+\.\w+)`", WORDS):
        assert (ROOT / name).is_file(), f"{name} is missing"


def test_every_make_target_that_is_named_exists_and_make_lists_them_all():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"(?:^    |`)make (\w+)", WORDS, re.MULTILINE):
        assert re.search(rf"^(?:[\w ]+ )?{target}(?: [\w ]+)?:", makefile, re.MULTILINE), f"make {target}"
    listed = re.search(r"^help:.*?\n\n", makefile, re.MULTILINE | re.DOTALL).group()
    for target in re.search(r"^\.PHONY: help (.*)$", makefile, re.MULTILINE).group(1).split():
        assert re.search(rf"make {target}\b", listed), f"make {target} is missing in what make lists"


def anchors(text: str) -> set[str]:
    """Anchors of a page's headings, as they are made for Markdown."""
    text = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    return {
        re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    }


@pytest.mark.parametrize("page", TEXT)
def test_every_picture_file_and_heading_that_is_linked_exists(page: str):
    for link in re.findall(r"\]\(([^)\s]+)\)", TEXT[page]):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        linked = (ROOT / page).parent / path if path else ROOT / page
        assert linked.is_file(), f"{page} links to {link}, which is missing"
        if anchor:
            assert anchor in anchors(linked.read_text(encoding="utf-8")), f"{page}: no heading for {link}"


@pytest.mark.parametrize("page", TEXT)
def test_a_table_ends_at_an_empty_line(page: str):
    lines = re.sub(r"^```.*?^```$", "", TEXT[page], flags=re.MULTILINE | re.DOTALL).splitlines()
    for line, following in pairwise(lines):
        assert not line.startswith("|") or following.startswith("|") or not following, (
            f"{page}: {following} after a table"
        )


def test_every_page_and_picture_of_the_documentation_is_shown_somewhere():
    docs = ROOT / "docs"
    for path in docs.rglob("*"):
        if path.suffix in {".png", ".jpg"}:
            assert f"({path.relative_to(docs).as_posix()})" in TEXT["docs/gallery.md"], f"{path.name} is in no gallery"
        elif path.suffix == ".md" and path.name != "index.md":
            assert f"\n{path.stem}\n" in TEXT["docs/index.md"], f"docs/{path.name} is in no table of contents"
            assert f"({path.name})" in TEXT["docs/index.md"]


INCLUDE = r"^```\{literalinclude\} (\S+)\n((?:^:.*\n)*)```$"


def included(page: str, path: str, options: str) -> str:
    """The lines of a file that a page shows, by the same rules as Sphinx; fails where they are not there."""
    text = ((ROOT / page).parent / path).read_text(encoding="utf-8")
    chosen = dict(re.findall(r"^:([\w-]+): (.*)$", options, re.MULTILINE))
    if name := chosen.get("pyobject"):
        (found,) = [n for n in ast.parse(text).body if isinstance(n, ast.FunctionDef | ast.ClassDef) and n.name == name]
        text = ast.get_source_segment(text, found) or ""
    for option, part in (("start-after", 2), ("end-before", 0)):
        if marker := chosen.get(option, "").strip('"'):
            assert marker in text, f"{page}: {path} has no {marker}"
            text = text.partition(marker)[part]
    return text


@pytest.mark.parametrize("page", [page for page, text in TEXT.items() if "{literalinclude}" in text])
def test_code_that_a_page_includes_is_there(page: str):
    shown = re.findall(INCLUDE, TEXT[page], re.MULTILINE)
    assert len(shown) == TEXT[page].count("{literalinclude}")
    for path, options in shown:
        assert included(page, path, options).strip(), f"{page} shows nothing of {path}"


def test_every_picture_of_the_gallery_stands_above_what_makes_it():
    parts = re.split(r"^!\[.*\]\((\S+)\)$", TEXT["docs/gallery.md"], flags=re.MULTILINE)
    assert len(parts) > 40
    for picture, below in zip(parts[1::2], parts[2::2], strict=True):
        below = below.partition("\n## ")[0]
        assert re.search(r"^    \S", below, re.MULTILINE), f"no command below {picture}"
        if script := re.search(r"^    python (\S+\.py)$", below, re.MULTILINE):
            assert f"{{literalinclude}} ../{script[1]}\n" in below, f"no code below {picture}"


def test_the_measured_block_keeps_its_markers():
    text = TEXT["docs/measured.md"]
    assert text.count("<!-- measured: begin -->") == text.count("<!-- measured: end -->") == 1
