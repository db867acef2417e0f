"""The plan of a placement as a picture: every body's outline, a disc or a capsule, colored by class, with a legend.

Drawn with Pillow at three times the size and averaged down: sharp down to bodies below a pixel, and 100,000 of them
take a few seconds.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ..errors import EshError
from ..files.placement_files import write_files
from ..problem.body_kind import disc_radius
from ..problem.given_values import FOREIGN_ERRORS, as_path_or_file, check_is, show
from ..problem.placement import Placement
from ..problem.placement_footprints import footprints_of_placement
from ..problem.slopes import foreshortened
from .halftone import line_axis
from .palette import Color, class_colors
from .periodic_copies import boxes_of_bodies, copies_of_bodies

if TYPE_CHECKING:
    from PIL import Image

    from ..problem.body_footprints import BodyFootprints

__all__ = ["draw_plan"]

PAPER: Color = (250, 249, 246)
GROUND: Color = (255, 255, 255)
FRAME: Color = (206, 202, 194)
INK: Color = (52, 52, 56)
FAINT_INK: Color = (128, 126, 122)

PLAN_PIXELS = 1600
# Points of the arc around a corner of a rounded outline.
ARC_POINTS = 12
MARGIN = 56
# What is left free around bodies that reach over the border, and that distance at most, as a share of the plan.
CLEARANCE = 8
MOST_REACH = 0.5
# From the plan, or what reaches over it, to the title's baseline.
TITLE_GAP = 22
OVERSAMPLING = 3
LINE_HEIGHT = 40
# Where the sizes begin beside the name of their class, and what one takes besides its text.
LEGEND_INDENT = 300
ENTRY_GAP = 84
# Radius and half the length of the axis of what stands for lines there, and how it is turned.
SWATCH_LINE = (3.5, 11.0)
SWATCH_ANGLE = math.radians(25.0)
# Latin, Greek, Cyrillic and much more, in 750 kB; its license lies beside it.
FONT = Path(__file__).parent / "fonts" / "DejaVuSans.ttf"
# Sizes of one class that the legend lists; the rest is counted together.
MOST_SIZES_LISTED = 8


def draw_plan(
    placement: Placement,
    path: str | Path | BinaryIO,
    *,
    colors: Sequence[Any] | None = None,
    background: np.ndarray | None = None,
) -> None:
    """Draw a placement seen from above and save it as a PNG.

    Args:
        placement: What to draw.
        path: File name, or a file open for writing bytes.
        colors: One color per class: names or hex codes as Pillow knows them, or three numbers 0..1; where None, ten of
            a palette, and then further ones that are unlike each other. Smaller sizes of a class are drawn lighter.
        background: Picture under the bodies, stretched over the domain: shape ``[height, width]`` or
            ``[height, width, 3]``, values 0..1, row 0 its top; shown faintly.

    Raises:
        EshError: Fewer colors than classes, a color that is none, a background of another shape, or a file that cannot
            be written.
    """
    problem = check_is(placement, Placement, "`placement`").problem
    out = as_path_or_file(path)
    class_color = _class_colors(colors, len(problem.classes))
    size_color = [
        _shades(color, [size.mean_area for size in k.sizes])
        for color, k in zip(class_color, problem.classes, strict=True)
    ]

    width, height = problem.rectangle.size
    scale = PLAN_PIXELS / max(width, height)
    plan_width, plan_height = max(1, round(width * scale)), max(1, round(height * scale))
    reach = _reach_over_border(placement, scale)
    margin = max(MARGIN, reach + CLEARANCE)
    plan = _draw_bodies(placement, scale, margin, (plan_width, plan_height), size_color, background)

    canvas_width = max(plan_width + 2 * margin, 900)
    lines = _legend_lines(placement, scale, class_color, size_color, canvas_width - 2 * margin)
    sheet = _compose(plan, (plan_width, plan_height), canvas_width, lines, placement, reach)
    if isinstance(out, Path):
        write_files({out: lambda file: sheet.save(file, format="PNG")})
    else:
        sheet.save(out, format="PNG")


def _reach_over_border(placement: Placement, scale: float) -> int:
    """How far bodies of an open domain reach over its border, in pixels of the plan."""
    domain = placement.problem.rectangle
    if domain.periodic or not len(placement.position):
        return 0
    low, high = boxes_of_bodies(placement)
    reach = max(-float(low.min()), float((high - domain.size).max()), 0.0)
    return math.ceil(min(reach, MOST_REACH * max(domain.size)) * scale)


def _draw_bodies(
    placement: Placement,
    scale: float,
    margin: int,
    plan_size: tuple[int, int],
    size_color: list[list[Color]],
    background: np.ndarray | None,
) -> Image.Image:
    """Return the domain with its bodies and a margin around it, into which bodies at an open border may reach."""
    from PIL import Image, ImageDraw

    domain = placement.problem.rectangle
    plan_width, plan_height = plan_size
    margin, fine = margin * OVERSAMPLING, scale * OVERSAMPLING
    fine_width, fine_height = plan_width * OVERSAMPLING, plan_height * OVERSAMPLING
    image = Image.new("RGB", (fine_width + 2 * margin, fine_height + 2 * margin), PAPER)
    ground = Image.new("RGB", (1, 1), GROUND) if background is None else _faint(background)
    image.paste(ground.resize((fine_width, fine_height), Image.Resampling.BICUBIC), (margin, margin))
    draw = ImageDraw.Draw(image)
    draw.rectangle(
        (margin, margin, margin + fine_width - 1, margin + fine_height - 1), outline=FRAME, width=OVERSAMPLING
    )

    # A disc larger than the picture fills it; Pillow need not know by how much.
    most = 4.0 * math.hypot(*image.size)
    footprints = footprints_of_placement(placement)
    tilt = footprints.tilts(placement.id, placement.problem.seed)
    slopes = footprints.slopes_at(placement.position, domain.size, tilt)
    copies = copies_of_bodies(placement)
    body = np.concatenate([np.flatnonzero(seen) for _, seen in copies])
    position = np.concatenate([placement.position[seen] + shift for shift, seen in copies])
    radius = np.minimum(placement.radius[body] * fine, most)
    center = np.column_stack([margin + position[:, 0] * fine, margin + fine_height - position[:, 1] * fine])
    # Large ones first: whatever overlaps, nothing is hidden altogether.
    order = np.argsort(-radius, kind="stable")
    class_index, size_index = placement.class_index[body].tolist(), placement.size_index[body].tolist()
    boxes = np.column_stack([center - radius[:, None], center + radius[:, None]]).tolist()
    rims = np.clip(radius * 0.08, 0, 1.2 * OVERSAMPLING).round().astype(int).tolist()
    rim_color = [[_mix(color, (0, 0, 0), 0.28) for color in shades] for shades in size_color]
    # Points along the axes of lines, from the middles of their bodies, in pixels.
    axes = {
        int(i): (line_axis(placement, int(i)) - placement.position[i]) * [fine, -fine]
        for i in np.flatnonzero((placement.width > 0.0) & ~footprints.is_outline)
    }
    for index in order.tolist():
        c, s = class_index[index], size_index[index]
        axis = axes.get(int(body[index]))
        if footprints.is_outline[body[index]]:
            _draw_outline(
                draw,
                center[index],
                _outline(placement, footprints, int(body[index]), None if slopes is None else slopes[body[index]])
                * fine,
                rims[index],
                (size_color[c][s], rim_color[c][s]),
            )
            continue
        if axis is not None:
            points, rim = center[index] + axis, rims[index]
            if rim:
                _draw_capsule(draw, points, radius[index], rim_color[c][s])
            _draw_capsule(draw, points, radius[index] - rim, size_color[c][s])
            continue
        draw.ellipse(boxes[index], fill=size_color[c][s], outline=rim_color[c][s], width=rims[index])
    if domain.periodic:
        inside = image.crop((margin, margin, margin + fine_width, margin + fine_height))
        image.paste(PAPER, (0, 0, *image.size))
        image.paste(inside, (margin, margin))
    return image.reduce(OVERSAMPLING)


def _outline(placement: Placement, footprints: BodyFootprints, body: int, slope: np.ndarray | None) -> np.ndarray:
    """Corners of a body's outline as it is turned, and leans in a plane of a ``slope``, from its position [m]; y up."""
    c, s = math.cos(placement.angle[body]), math.sin(placement.angle[body])
    points = footprints.shapes[footprints.shape[body]].outline(ARC_POINTS) * footprints.factor[body]
    turned = points @ np.array([[c, s], [-s, c]])
    return turned if slope is None else foreshortened(turned, slope)


def _draw_outline(draw: Any, center: np.ndarray, outline: np.ndarray, rim: int, colors: tuple[Color, Color]) -> None:
    """Draw a polygon with a rim inside of it; its points are seen from ``center``, in pixels with y up."""
    corners = [tuple(point) for point in (center + outline * [1.0, -1.0]).tolist()]
    draw.polygon(corners, fill=colors[0], outline=colors[1] if rim else None, width=max(1, rim))


def _draw_capsule(draw: Any, points: np.ndarray, radius: float, color: Color | int) -> None:
    """Draw a thick line with round ends through ``points``, on the picture's scale."""
    corners = [tuple(point) for point in points.tolist()]
    draw.line(corners, fill=color, width=max(1, round(2.0 * radius)), joint="curve")
    if radius >= 1.0:
        for x, y in (corners[0], corners[-1]):
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=color)


# What stands on one line of the legend, laid out from left to right: color, radius of the swatch, half the length of
# its axis (0: a disc), text.
_Entry = tuple[Color, float, float, str]
_Line = list[_Entry]


def _legend_lines(
    placement: Placement, scale: float, class_color: list[Color], size_color: list[list[Color]], width: int
) -> list[tuple[str, Color, _Line]]:
    """Return one line per class, or more where its sizes do not fit into ``width``: its name, color and sizes."""
    lines: list[tuple[str, Color, _Line]] = []
    for c, body_class in enumerate(placement.problem.classes):
        in_class = placement.class_index == c
        entries: _Line = []
        for s, size in enumerate(body_class.sizes[:MOST_SIZES_LISTED]):
            count = int((in_class & (placement.size_index == s)).sum())
            text = f"{_short(size.name)}  {count:,}"
            if size.is_range:
                text += ", areas {:.3g} to {:.3g}".format(*size.area_span)
            if not size.kind.has_axis:
                radius, half = min(max(disc_radius(size.mean_area) * scale, 5.0), 15.0), 0.0
            else:
                radius, half = SWATCH_LINE
            entries.append((size_color[c][s], radius, half, text))
        rest = int((in_class & (placement.size_index >= MOST_SIZES_LISTED)).sum())
        if rest:
            more = f"{len(body_class.sizes) - MOST_SIZES_LISTED} more sizes  {rest:,}"
            entries.append((class_color[c], 6.0, 0.0, more))
        name = f"{_short(body_class.name)}  {int(in_class.sum()):,}"
        line: _Line = []
        used = float(LEGEND_INDENT)
        for entry in entries:
            needed = ENTRY_GAP + _font(22, entry[-1]).getlength(entry[-1])
            if line and used + needed > width:
                lines.append((name, class_color[c], line))
                name, line, used = "", [], float(LEGEND_INDENT)
            line.append(entry)
            used += needed
        lines.append((name, class_color[c], line))
    return lines


def _compose(
    plan: Image.Image,
    plan_size: tuple[int, int],
    canvas_width: int,
    lines: list[tuple[str, Color, _Line]],
    placement: Placement,
    reach: int,
) -> Image.Image:
    """Put title, plan and legend on one sheet; bodies ``reach`` over the plan's border by so many pixels."""
    from PIL import Image, ImageDraw

    plan_width, plan_height = plan_size
    margin = (plan.height - plan_height) // 2
    above = max(TITLE_GAP, reach + CLEARANCE)
    top = 40 + above - TITLE_GAP
    legend_top = top + plan_height + 2 * margin - 8
    canvas = Image.new("RGB", (canvas_width, legend_top + LINE_HEIGHT * len(lines) + 36), PAPER)
    left = (canvas_width - plan.width) // 2
    canvas.paste(plan, (left, top))
    draw = ImageDraw.Draw(canvas)
    domain = placement.problem.rectangle
    title = f"{len(placement.position):,} bodies on {_length(domain.size[0])} by {_length(domain.size[1])}"
    if domain.periodic:
        title += ", periodic"
    line = top + margin - above
    _write(draw, (left + margin, line), title, INK, 24, "ls")
    _draw_scale_bar(draw, left + margin + plan_width, line, plan_width / domain.size[0], domain.size[0])

    for number, (name, color, entries) in enumerate(lines):
        x, y = left + margin, legend_top + LINE_HEIGHT * number + LINE_HEIGHT // 2
        if name:
            _write(draw, (x, y), name, _mix(color, (0, 0, 0), 0.25), 24, "lm")
        x += LEGEND_INDENT
        for entry_color, radius, half, text in entries:
            _draw_swatch(canvas, (x, y), radius, half, entry_color)
            _write(draw, (x + 26, y), text, INK, 22, "lm")
            x += int(ENTRY_GAP + _font(22, text).getlength(text))
    return canvas


def _length(meters: float) -> str:
    """A length in words, to four digits."""
    return f"{float(f'{meters:.4g}'):,g} m"


def _draw_scale_bar(draw: Any, right: int, y: int, scale: float, width: float) -> None:
    """Draw a bar of a round length (1, 2 or 5 times a power of ten), at most a quarter of the plan."""
    power = 10.0 ** math.floor(math.log10(width / 4))
    length = max(factor for factor in (1, 2, 5) if factor * power <= width / 4 or factor == 1) * power
    pixels = round(length * scale)
    draw.line([(right - pixels, y - 2), (right, y - 2)], FAINT_INK, 2)
    for end in (right - pixels, right):
        draw.line([(end, y - 8), (end, y + 3)], FAINT_INK, 2)
    _write(draw, (right - pixels - 12, y), f"{length:g} m", FAINT_INK, 20, "rs")


def _draw_swatch(canvas: Image.Image, center: tuple[int, int], radius: float, half_length: float, color: Color) -> None:
    """Draw a disc, or a capsule rising to the right, with smooth edges."""
    from PIL import Image, ImageDraw

    half, fine = math.ceil(radius + half_length) + 1, 8
    mask = Image.new("L", (2 * half * fine, 2 * half * fine))
    end = half_length * np.array([math.cos(SWATCH_ANGLE), -math.sin(SWATCH_ANGLE)])
    _draw_capsule(ImageDraw.Draw(mask), (half + np.array([-end, end])) * fine, radius * fine, 255)
    mask = mask.reduce(fine)
    canvas.paste(color, (center[0] - half, center[1] - half), mask)


def _faint(background: np.ndarray) -> Image.Image:
    from PIL import Image

    try:
        picture = np.asarray(background)
    except FOREIGN_ERRORS:
        raise EshError(f"`background` must be an array of numbers; got {show(background)}") from None
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    if picture.ndim != 3 or picture.shape[2] != 3 or picture.size == 0 or picture.dtype.kind not in "buif":
        raise EshError(f"`background` must have shape [height, width] or [height, width, 3]; got {list(picture.shape)}")
    picture = np.clip(np.nan_to_num(picture.astype(np.float64)), 0.0, 1.0)
    return Image.fromarray(np.round(255 * (0.55 + 0.45 * picture)).astype(np.uint8), "RGB")


def _class_colors(colors: Sequence[Any] | None, class_count: int) -> list[Color]:
    if colors is None:
        return class_colors(class_count)
    try:
        listed = list(colors)
    except FOREIGN_ERRORS:
        raise EshError(f"`colors` must be a list of colors; got {show(colors)}") from None
    if len(listed) < class_count:
        raise EshError(f"`colors` must hold one color per class, {class_count}; got {len(listed)}")
    return [_color(color) for color in listed[:class_count]]


def _color(color: Any) -> Color:
    from PIL import ImageColor

    try:
        if isinstance(color, str):
            red, green, blue = ImageColor.getrgb(color)[:3]
            return red, green, blue
        red, green, blue = (round(255 * min(max(float(value), 0.0), 1.0)) for value in tuple(color)[:3])
        return red, green, blue
    except (TypeError, ValueError):
        raise EshError(f"a color is a name, a hex code or three numbers 0..1; got {color!r}") from None


def _shades(color: Color, areas: list[float]) -> list[Color]:
    """Return the color of each size: the class's own for the largest, up to a third lighter for the smallest."""
    ranks = np.argsort(np.argsort(-np.array(areas), kind="stable"), kind="stable")
    return [_mix(color, (255, 255, 255), 0.34 * rank / max(len(areas) - 1, 1)) for rank in ranks.tolist()]


def _mix(color: Color, other: Color, share: float) -> Color:
    red, green, blue = (round((1 - share) * a + share * b) for a, b in zip(color, other, strict=True))
    return red, green, blue


def _short(name: str) -> str:
    return name if len(name) <= 24 else f"{name[:22]}..."


def _write(draw: Any, corner: tuple[float, float], text: str, color: Color, size: int, anchor: str) -> None:
    draw.text(corner, text, color, _font(size, text), anchor=anchor)


def _font(size: int, text: str) -> Any:
    """Return Pillow's own font, or one that knows more letters than ASCII where ``text`` has them."""
    from PIL import ImageFont

    if not text.isascii():
        # The extension's zip leaves the font out; a Pillow may come without FreeType.
        with contextlib.suppress(OSError, ImportError):
            return ImageFont.truetype(str(FONT), round(size * 0.86))
    return ImageFont.load_default(size)
