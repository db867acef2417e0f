"""Scripts, the sidebar and what makes a result out of date know the same settings."""

import dataclasses
import inspect
import re

import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.engine.problem.body_class import BodyClass, ClassSettings, Unsharp  # noqa: E402
from esh.engine.problem.scatter_settings import ScatterSettings, Standing  # noqa: E402
from esh.engine.problem.settings import Choice, Settings, setting, settings_of  # noqa: E402
from esh.engine.problem.size import Size  # noqa: E402
from esh.esh_scatter.properties.described import shown_settings, values_from, with_properties  # noqa: E402
from esh.esh_scatter.properties.influential_settings import AT_ONCE, WITHOUT_INFLUENCE  # noqa: E402
from esh.esh_scatter.properties.scatter import BY_HAND  # noqa: E402


def new_object(name):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (20, 0, 0), (20, 20, 0), (0, 20, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.fixture
def scatter(empty_file):
    made = bpy.context.scene.esh_scatter.add_scatter(new_object("Ground"))
    made.add_class().sizes[0].source_object = new_object("Tree")
    return made


def changed(group, name):
    """Another value for a property."""
    told = group.bl_rna.properties[name]
    value = getattr(group, name)
    if getattr(told, "is_array", False):
        return [entry + 0.25 for entry in value]
    if told.type == "ENUM":
        return next(item.identifier for item in told.enum_items if item.identifier != value)
    if told.type == "BOOLEAN":
        return not value
    if told.type == "STRING":
        return f"{value} other"
    return value + 1 if told.type == "INT" else value + (0.25 if value + 0.25 <= told.hard_max else -0.25)


def shown_of(scatter):
    """The group, and the property that stands for a setting there."""
    for shown in shown_settings(ScatterSettings, BY_HAND):
        yield scatter, ScatterSettings, shown
    for shown in shown_settings(Standing):
        yield scatter.classes[0], Standing, shown
    for shown in shown_settings(ClassSettings):
        yield scatter.classes[0], ClassSettings, shown
    for shown in shown_settings(Size, set(settings_of(Size)) - {"distribution"}):
        yield scatter.classes[0].sizes[0], Size, shown


def test_classes_and_sizes_of_blender_have_all_settings_of_the_engine_s():
    for ours, theirs in ((esh.ScatterClass, BodyClass), (esh.ScatterSize, Size)):
        # Outlines are those of the objects, and so are usual areas.
        asked = settings_of(theirs).keys() - {"footprint", "usual_area"}
        assert asked <= settings_of(ours).keys() == inspect.signature(ours).parameters.keys()


def test_scatter_and_its_job_take_every_setting_by_name():
    for taking in (esh.scatter, esh.ScatterJob):
        taken = inspect.signature(taking).parameters
        assert settings_of(ScatterSettings).keys() <= taken.keys()
        for name, one in settings_of(ScatterSettings).items():
            assert taken[name].default == one.default and taken[name].kind is taken[name].KEYWORD_ONLY
            if taking is esh.scatter:
                assert f"    {name}: {one.setting.help[:30]}" in taking.__doc__


def test_settings_can_be_kept_and_handed_in_as_one():
    bpy.ops.wm.read_homefile(use_empty=True)
    ground, tree = new_object("Ground"), new_object("Tree")
    classes = [esh.ScatterClass("tree", [esh.ScatterSize("one", 20, tree, area=0.5)])]
    kept = esh.ScatterSettings(seed=3, random_turn=0.5, device="cpu", max_steps=4, class_separation=0.25)
    job = esh.ScatterJob(ground, classes, kept, seed=4)
    assert job.settings == dataclasses.replace(kept, seed=4) or vars(job.settings) == vars(kept) | {"seed": 4}
    assert (job.problem.seed, job.problem.balance.class_separation, job.problem.avoid_overlap) == (4, 0.25, True)
    one = esh.scatter(ground, classes, kept).placement.position
    other = esh.scatter(
        ground, classes, seed=3, random_turn=0.5, device="cpu", max_steps=4, class_separation=0.25
    ).placement.position
    assert one.tobytes() == other.tobytes()
    with pytest.raises(esh.EshError, match="`settings` must be ScatterSettings, or None; got"):
        esh.ScatterJob(ground, classes, {"seed": 3})
    with pytest.raises(esh.EshError, match="`sead` is not a known setting; did you mean `seed`"):
        esh.scatter(ground, classes, sead=3)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("max_step", "did you mean `max_steps`"),
        ("Obstacle", "did you mean `obstacles`"),
        ("zzz", "known are .*avoid_overlap.*progress"),
    ],
)
def test_a_setting_that_is_not_known_is_a_sentence(scatter, name, said):
    """It was a TypeError of dataclasses."""
    tree = esh.ScatterClass("tree", [esh.ScatterSize("any", 4, bpy.data.objects["Tree"])])
    with pytest.raises(esh.ProblemError, match=f"`{name}` is not a known setting; {said}"):
        esh.scatter(bpy.data.objects["Ground"], [tree], **{name: 3})


def test_of_a_setting_of_a_class_or_a_size_that_is_given_to_the_run_it_is_said_where_it_belongs(scatter):
    size = esh.ScatterSize("any", 4, bpy.data.objects["Tree"])
    tree = esh.ScatterClass("tree", [size])
    for name, place in (("gap", "ScatterClass"), ("density", "ScatterClass"), ("weights", "ScatterSize")):
        said = rf"`{name}` is not a known setting; it belongs to {place}: {place}\(\.\.\., {name}=\.\.\.\)$"
        with pytest.raises(esh.ProblemError, match=said):
            esh.scatter(bpy.data.objects["Ground"], [tree], **{name: 3})
    with pytest.raises(
        TypeError, match=r"`max_steps` is not a setting of ScatterClass; it belongs to scatter: scatter\("
    ):
        esh.ScatterClass("tree", [size], max_steps=3)
    with pytest.raises(TypeError, match=r"`gap` is not a setting of ScatterSettings; it belongs to ScatterClass: "):
        esh.ScatterSettings(gap=3)
    with pytest.raises(TypeError, match=r"`gap` is not a setting of ScatterSize; it belongs to ScatterClass: "):
        esh.ScatterSize("any", 4, bpy.data.objects["Tree"], gap=3)


def test_the_sidebar_passes_on_its_settings_and_begins_with_the_defaults_of_scripts(scatter):
    defaults, given = esh.ScatterSettings(), scatter.arguments(bpy.context.scene)[1]
    assert settings_of(ScatterSettings).keys() <= given.keys() | settings_of(Standing).keys()
    for name in settings_of(ScatterSettings).keys() - settings_of(Standing).keys():
        assert given[name] == pytest.approx(getattr(defaults, name)), name
    own = scatter.classes[0].as_argument()
    for name in settings_of(Standing):
        assert getattr(own.standing, name) == pytest.approx(getattr(defaults, name)), name
    assert (own.density_correction, own.unsharp) == (False, None)
    for group, cls, shown in shown_of(scatter):
        if shown.switch:
            setattr(group, shown.switch, True)
        before = values_from(group, cls, OF_GROUPS[cls])
        setattr(group, shown.name, changed(group, shown.name))
        assert values_from(group, cls, OF_GROUPS[cls]) != before, shown.name
    assert scatter.classes[0].sizes[0].as_argument().distribution == "uniform"
    # Nothing of the target is called so.
    for name in ("face_material", "face_group", "face_attribute"):
        setattr(scatter, name, "")
    scatter.surface, scatter.both_sides = "ABOVE", False
    positional, named = scatter.arguments(bpy.context.scene)
    assert esh.ScatterJob(*positional, **{**named, "device": "cpu"}).settings.max_steps == 101


OF_GROUPS = {
    ScatterSettings: BY_HAND,
    ClassSettings: (),
    Standing: (),
    Size: set(settings_of(Size)) - {"distribution"},
}


def test_every_setting_that_needs_solving_makes_a_result_outdated(scatter):
    scatter.remember(new_object("Result"), {"steps": 3})
    for group, _, shown in shown_of(scatter):
        # The scale shows at once, too, in a result that has what it takes: test_scale.py.
        if shown.name in AT_ONCE | {"scale"}:
            continue
        before = getattr(group, shown.name)
        setattr(group, shown.name, changed(group, shown.name))
        assert scatter.outdated, shown.name
        setattr(group, shown.name, before)
        assert not scatter.outdated, shown.name


def test_the_sidebar_calls_settings_as_their_descriptions_do(scatter):
    for group, _, shown in shown_of(scatter):
        assert group.bl_rna.properties[shown.name].name == shown.setting.label, shown.name
    told = scatter.classes[0].bl_rna.properties
    for name, one in settings_of(esh.Amount).items():
        named = told[{"cover": "cover_share"}.get(name, name)]
        assert (named.name, named.description) == (one.label, one.setting.help)


def test_an_amount_is_described_and_checked_as_other_settings_are():
    assert re.findall(r"^    (\w+): ", esh.Amount.__doc__.partition("Raises:")[0], re.MULTILINE) == list(
        settings_of(esh.Amount)
    )
    assert esh.Amount(distance=2).distance == 2.0
    with pytest.raises(esh.EshError, match="`cover` of an Amount must be a number above 0, and finite; got 0"):
        esh.Amount(cover=0)
    with pytest.raises(esh.EshError, match="an Amount must have one of"):
        esh.Amount(cover=0.5, distance=1.0)


def test_what_has_no_influence_is_there(scatter):
    """A name that is misspelled, or of a property that is gone, would hide another one."""
    groups = (scatter, scatter.classes[0], scatter.classes[0].sizes[0])
    assert {name for group in groups for name in group.bl_rna.properties.keys()} >= WITHOUT_INFLUENCE  # noqa: SIM118


@dataclasses.dataclass(frozen=True)
class Wind(Settings):
    speed: float = dataclasses.field(
        default=2.0, metadata=setting("How fast", unit="m", low=0.0, high=30.0, soft_high=9.0)
    )
    gusts: int = dataclasses.field(default=3, metadata=setting("How often", low=1))
    steady: bool = dataclasses.field(default=True, metadata=setting("Whether it never changes"))
    kind: str = dataclasses.field(
        default="land",
        metadata=setting("Where from", choices=(Choice("sea", "Sea", "wet", "S"), Choice("land", "Land", "dry", "L"))),
    )
    range: tuple[float, float] = dataclasses.field(default=(1.0, 2.0), metadata=setting("From where to where"))
    unsharp: Unsharp | None = dataclasses.field(default=None, metadata=setting("Blurs", label="Blur", of=Unsharp))


def test_a_new_setting_is_one_line():
    @with_properties(Wind, unsharp_radius={"default": 20.0})
    class ESH_PG_wind(bpy.types.PropertyGroup):
        pass

    bpy.utils.register_class(ESH_PG_wind)
    bpy.types.WindowManager.esh_wind = bpy.props.PointerProperty(type=ESH_PG_wind)
    try:
        group = bpy.context.window_manager.esh_wind
        assert Wind(**values_from(group, Wind)) == Wind()
        group.use_unsharp, group.gusts, group.kind = True, 7, "S"
        assert Wind(**values_from(group, Wind)) == Wind(gusts=7, kind="sea", unsharp=Unsharp(1.0, 20.0))
        told = group.bl_rna.properties
        assert (told["speed"].hard_min, told["speed"].hard_max, told["speed"].soft_max) == (0.0, 30.0, 9.0)
        assert (told["speed"].unit, told["speed"].description) == ("LENGTH", "How fast")
        assert (told["use_unsharp"].name, told["unsharp_amount"].name) == ("Blur", "Amount")
        assert [item.description for item in told["kind"].enum_items] == ["Wet", "Dry"]
    finally:
        del bpy.types.WindowManager.esh_wind
        bpy.utils.unregister_class(ESH_PG_wind)


def test_a_setting_that_needs_a_form_of_its_own_is_not_forgotten():
    with pytest.raises(AssertionError, match=r"ScatterSettings\.non_overlap needs a form of its own in the sidebar"):
        list(shown_settings(ScatterSettings))
