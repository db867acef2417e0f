"""The electrostatic field of charges and target densities, by particle-particle particle-mesh (P3M).

The paper (Schmaltz, Gwosdek and Weickert 2012) sums over all pairs, in its equations 1 and 2. Here the kernel K = -log r is split
into a smooth far part, convolved on a mesh, and a near part of finite reach, summed over neighbors (Hockney and Eastwood, Computer
Simulation Using Particles, 1981, chapter 8); see :mod:`.splitting`. Charges and targets are blurred alike; see :mod:`.blur`.

Units: the solver's length unit makes the mean number density 1, and its charge unit is the mean charge.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..device.launcher import GRAIN, GRAIN_OF_NEIGHBORS, Launcher
from ..space import kernels_cells
from ..space.cell_sort import CellSort
from ..space.mesh_layout import MeshLayout
from ..space.part import Part
from ..space.space import Space
from ..space.target_deposit import deposit_images, mix_images
from . import blur, kernels_feedback, kernels_field, kernels_gather, kernels_near, kernels_splines
from .blur import LEAST_OF_SMALL, USUAL_REGULARITY, BlurSettings
from .field_meshes import FEWEST_NODES, charge_mesh, cutoff_of
from .field_targets import FieldTarget, TargetImages, distinct_images
from .influence import convolution_of, far_influence
from .near_tiles import every_other, lots_of
from .target_correction import TargetCorrection
from .target_feedback import TargetFeedback

__all__ = ["Field"]

# Bands of cells that CPU threads deposit the charges of, for every thread: enough that a crowded one keeps no thread waiting.
BANDS_PER_THREAD = 8
# Nodes that a band is high, at least: splines reach four.
NODES_OF_BAND = 6
# Threads of a GPU that run at once, about, and how many of them share the neighbors of a charge at most.
THREADS_OF_GPU = 1 << 18
MOST_THREADS_OF_CHARGE = 4
# The mesh of a few charges is fine beside their spacing, and the near part short. So few are blurred no more widely than it reaches,
# unless they are to be less regular than usual; for more it reaches as far as their blur takes. Measured on 60 to 200 bodies: coverage
# errors at 1 spacing fall from .0089 to .0036 and from .0042 to .0027, and smallest spacings rise by .02; those of two classes of five
# bodies fall from .88 to .80 of what each has alone.
FEW_CHARGES = 60


class Field:
    """Evaluates the force per unit charge, -grad of sum_h M[g, h] K * (rho_h - u_h), at every charge of group g.

    Args:
        launcher: Where to run.
        space: Where the charges may be.
        interaction: M, shape ``[group_count, group_count]``.
        targets: One per group.
        spacing: Typical distance of neighboring bodies where they are dense; sets the mesh.
        charge: Charge of every particle, shape ``[n]``.
        charge_group: Its group, shape ``[n]``.
        whole_charge: What charges were before they faded towards a cut, shape ``[n]``: their blur is that of bodies of this size. None
            if none faded.
        family: Family of every group, shape ``[group_count]``; None for a single one. Charges of two families are blurred less.
        blur_settings: How charges and targets are blurred.
        fewest_nodes: Least number of nodes of the targets' mesh; None for the usual one.
        part: The part of the space that holds all charges and targets; None if that is not small. Meshes and cells lie over it alone,
            in coordinates of their own, and it ends at its edges, whatever the space does.

    Attributes:
        layout: The charges' mesh.
        mesh: The same as kernels take it.
        cutoff: Distance beyond which there is no near part.
        blur: How charges and targets are blurred.
        core: Strength of the core of every charge.
        core_end: Squared distance over the pair's variance, halved, at which it ends.
        fine_layout: The mesh that this is known on.
        images: The images of the targets, one per class.
        image_of_class: Index of every class's image among them, where bodies follow it.
        deposited: Share of every image's integral at every node, flat, one image after the other.
        attraction: Sum over h of M[g, h] u_h as charge per node, flat, one group after the other.
        mean_attraction: Its mean as charge per area, shape ``[group_count]``.
        feedback: Changes it by how dense charges stand; None unless :meth:`prepare_feedback` was called.
    """

    def __init__(
        self,
        launcher: Launcher,
        *,
        space: Space,
        interaction: np.ndarray,
        targets: Sequence[FieldTarget],
        spacing: float,
        charge: np.ndarray,
        charge_group: np.ndarray,
        whole_charge: np.ndarray | None = None,
        family: np.ndarray | None = None,
        blur_settings: BlurSettings | None = None,
        fewest_nodes: int | None = None,
        part: Part | None = None,
    ) -> None:
        self.launcher = launcher
        self._take_part(space, part)
        self.group_count, self.charge_count = len(targets), len(charge)
        images = distinct_images(targets)
        uniform = images.uniform
        asked = BlurSettings() if blur_settings is None else blur_settings
        blur_over_spacing = asked.over_spacing
        if blur_over_spacing is None:
            blur_over_spacing = blur.blur_over_spacing(asked.regularity, uniform)
        self.layout = charge_mesh(
            self.space,
            spacing,
            charge_count=self.charge_count,
            group_count=self.group_count,
            on_gpu=launcher.device.is_cuda,
            blur_over_spacing=blur_over_spacing,
        ).in_part(self._origin, self._whole)
        wide = asked.smooth or asked.regularity < USUAL_REGULARITY or self.charge_count > FEW_CHARGES
        self.cutoff = cutoff_of(self.layout, blur_over_spacing * spacing if wide else 0.0)
        self.mesh, self.node_count = self.layout.for_kernels(), self.layout.node_count
        self._convolution = convolution_of(launcher, self.layout, self.group_count)
        self._interaction = launcher.array(interaction.ravel().astype(np.float32), float)
        self._choose_cells()
        self._make_room(interaction)
        self._lay_images(images, interaction @ images.charge)
        self._influence = launcher.shared(
            ("influence", self.layout, self.cutoff), lambda: far_influence(self._convolution, self.layout, self.cutoff)
        )
        family = np.zeros(len(targets)) if family is None else family
        same = np.equal.outer(family, family)
        self._correction = TargetCorrection(
            launcher,
            space=self.space,
            within=(self._origin, self._whole),
            images=images,
            attraction=np.stack([(interaction * same) @ images.charge, (interaction * ~same) @ images.charge]),
            sharper=asked.sharper,
            number=images.followers(charge_group),
            spacing=spacing,
            charge=charge if whole_charge is None else whole_charge,
            blur_over_spacing=blur_over_spacing,
            cutoff=self.cutoff,
            fewest_nodes=fewest_nodes or FEWEST_NODES,
        )
        self.blur, self.fine_layout = self._correction.blur, self._correction.layout
        self.core, self.core_end = blur.core(blur_over_spacing, uniform)
        self.core = 0.0 if asked.smooth else self.core
        self._corrected = self._correction.for_kernels()
        self._given = self._given_charges(charge, charge_group, whole_charge)
        self._places = self._blur_of_places(None if same.all() else family)
        self._blurred = self._blurred_by(asked.sharper)

    def _take_part(self, space: Space, part: Part | None) -> None:
        """Lie over a part of the space, or all of it."""
        self._whole = space
        self._origin = (0.0, 0.0) if part is None else part.origin(space.size)
        self.space = space if part is None else Space(part.extent(space.size))

    def _given_charges(
        self, charge: np.ndarray, group: np.ndarray, whole_charge: np.ndarray | None
    ) -> kernels_gather.GivenCharges:
        given = kernels_gather.GivenCharges()
        given.origin, given.extent = wp.vec2(*self._origin), wp.vec2(*self.space.size)
        given.charge, given.group = self.launcher.array(charge, float), self.launcher.array(group, wp.int32)
        given.size = given.charge if whole_charge is None else self.launcher.array(whole_charge, float)
        return given

    def _blur_of_places(self, family: np.ndarray | None) -> kernels_gather.BlurOfPlaces:
        """How the blur differs; ``family`` is that of every group, or None for a single one."""
        places = kernels_gather.BlurOfPlaces()
        places.by_family = int(family is not None)
        places.family_of_group = self.launcher.array(np.zeros(1) if family is None else family, wp.int32)
        places.by_size, places.by_place = int(not self.blur.constant), int(not self.blur.uniform)
        places.least, places.mesh, places.variance = LEAST_OF_SMALL, self._corrected.mesh, self.blur.variance
        return places

    def _make_room(self, interaction: np.ndarray) -> None:
        """Room for the charges in the order of their cells, and for what is on the mesh."""
        launcher, room = self.launcher, self.charge_count + kernels_near.LANES
        cell_count = self.cells.count_x * self.cells.count_y
        self._cell_sort = CellSort(launcher, self.charge_count, cell_count, spread=True)
        charges = kernels_cells.SortedCharges()
        charges.order, charges.cell_start = self._cell_sort.order, self._cell_sort.cell_start
        charges.x, charges.y, charges.charge = (launcher.zeros(room, float) for _ in range(3))
        charges.group = launcher.zeros(room, wp.int32)
        # A CPU keeps what a group sees of as many groups as it has lanes at hand, which saves the memory's time.
        charges.by_group = int(not launcher.device.is_cuda and self.group_count <= kernels_near.LANES)
        if charges.by_group:
            rows = np.zeros((self.group_count, kernels_near.LANES))
            rows[:, : self.group_count] = interaction
            charges.weight, charges.weight_stride = launcher.array(rows.ravel(), float), kernels_near.LANES
        else:
            charges.weight, charges.weight_stride = launcher.zeros(self.group_count * room, float), room
        self._sorted = charges
        if not launcher.device.is_cuda:
            # What is summed is taken away at once, so that these are 0 before every evaluation.
            self._near = kernels_field.SortedSums()
            self._near.x, self._near.y = (launcher.zeros(room, float) for _ in range(2))
            self._lots = lots_of(self.cells.count_y, self.cells.count_x, repeats=self.space.periodic)
            self._tile_count = sum(lot.count for lot in self._lots)
        self._node_charge = launcher.zeros(self.group_count * self.node_count, wp.int64)
        self._potential = launcher.empty(self.group_count * self.node_count, float)

    def _blurred_by(self, sharper: float) -> kernels_field.Blurred:
        """How sorted charges are blurred; ``sharper`` is what the variance between two families is divided by."""
        room = self.charge_count + kernels_near.LANES
        blurred = kernels_field.Blurred()
        blurred.family = self.launcher.zeros(room, wp.int32)
        # Where the blur is everywhere the same, this never changes.
        blurred.variance = self.launcher.array(np.broadcast_to(np.float32(self.blur.levels[0]), room), float)
        blurred.alike = int(self.blur.constant and not self._places.by_family)
        blurred.sharper, blurred.core, blurred.per_core = sharper, self.core, 1.0 / self.core_end
        return blurred

    def _choose_cells(self) -> None:
        along = kernels_field.COLUMNS_PER_CUTOFF, kernels_field.ROWS_PER_CUTOFF
        counts = [max(1, int(n * length / self.cutoff)) for n, length in zip(along, self.space.size, strict=True)]
        cells = kernels_cells.CellGrid()
        cells.count_x, cells.count_y = counts
        cells.inverse_size = wp.vec2(counts[0] / self.space.size[0], counts[1] / self.space.size[1])
        cells.origin, cells.space = wp.vec2(*self._origin), self.space.for_kernels()
        self.cells = cells

    def _lay_images(self, images: TargetImages, attracting: np.ndarray) -> None:
        """Lay the images on the mesh; ``attracting`` is the charge of each that every group sees, shape ``[groups, images]``."""
        self.images, self.image_of_class = images.images, images.of_class
        self.deposited = deposit_images(self.launcher, self.images, self.layout)
        self.attraction = mix_images(self.launcher, self.deposited, attracting, self.node_count)
        self.mean_attraction = attracting.sum(axis=1) / (self.node_count * self.layout.node_area)
        self._attracting = attracting
        self.feedback: TargetFeedback | None = None

    def evaluate(self, position: wp.array, field: wp.array) -> None:
        """Write the force per unit charge at every charge.

        Args:
            position: Charge positions inside the domain, ``wp.vec2``, shape ``[n]``.
            field: Receives the result, ``wp.vec2``, shape ``[n]``.
        """
        with self.launcher.phase("sort"):
            self._sort(position)
        if not self.launcher.device.is_cuda:
            with self.launcher.phase("deposit"):
                self._deposit(self.layout, self._node_charge)
        with self.launcher.phase("FFT"):
            self._solve_far_field()
        with self.launcher.phase("near field, interpolation"):
            self._add_near_and_far(field)

    def prepare_feedback(self, width: np.ndarray) -> None:
        """Make ready for targets that are changed by how dense charges stand, blurred over a ``width`` for every group."""
        self.feedback = TargetFeedback(
            self.launcher,
            layout=self.layout,
            images=self.images,
            attracting=self._attracting,
            interaction=self._interaction,
            attraction=self.attraction,
            width=width,
        )

    def correct_targets(self, position: wp.array) -> None:
        """Change the targets by how dense charges stand at ``position``; see :mod:`.target_feedback`."""
        assert self.feedback is not None

        def deposit(layout: MeshLayout, node_charge: wp.array) -> None:
            if self.launcher.device.is_cuda:
                given = [position, self._given, layout.for_kernels()]
                self.launcher.launch(kernels_feedback.deposit_given, self.charge_count, given, [node_charge])
                return
            self._sort(position)
            self._deposit(layout, node_charge)

        self.feedback.correct(deposit)

    def _add_near_and_far(self, field: wp.array) -> None:
        near = [self._sorted, self._blurred, self.cells, self.cutoff]
        far = [self.mesh, self._potential, self._corrected]
        if self.launcher.device.is_cuda:
            parts = _threads_of_charge(self.charge_count)
            self.launcher.launch(kernels_field.evaluate_field, parts * self.charge_count, [parts, *near, *far], [field])
            return
        for lot in self._lots:
            self.launcher.launch(
                kernels_near.add_pairs,
                lot.count,
                [lot.for_kernels, *near],
                [self._near],
                grain=max(1, GRAIN_OF_NEIGHBORS * self._tile_count // self.charge_count),
            )
        self.launcher.launch(
            kernels_field.add_far_field,
            self.charge_count,
            [self._sorted, self._blurred, *far],
            [self._near, field],
            grain=GRAIN_OF_NEIGHBORS,
        )

    def _sort(self, position: wp.array) -> None:
        """Put charges into the order of their cells; a GPU also deposits them on the mesh."""
        launch, sort, n = self.launcher.launch, self._cell_sort, self.charge_count
        given = [position, self._given, self._interaction, self.group_count, self._places]
        if sort.counting is not None:
            elements = sort.count(sort.counting, kernels_cells.count_charges, [position, self.cells])
            outputs = [sort.counting, self._sorted, self._blurred, self._node_charge]
            launch(kernels_gather.lay_charges, elements, [n, *given, self.mesh], outputs)
            return
        sort.sort(kernels_cells.compute_cell_keys, [position, self.cells])
        at_once = kernels_gather.GATHERED_AT_ONCE
        launch(
            kernels_gather.gather_charges,
            -(-n // at_once),
            [n, at_once, *given],
            [self._sorted, self._blurred],
            grain=GRAIN // at_once,
        )

    def _deposit(self, layout: MeshLayout, node_charge: wp.array) -> None:
        """Add sorted charges to the nodes of a mesh, on a CPU."""
        # Threads must not write to one node at once. Charges are sorted by rows of cells; two rows of the field's mesh are higher than
        # the four nodes that a spline reaches: bands that are as high never meet once every other one is left out.
        highest = int(self.space.size[1] / (NODES_OF_BAND * layout.spacing[1]))
        bands = max(1, min(BANDS_PER_THREAD * self.launcher.thread_count, self.cells.count_y // 2, highest))
        for first_band, count in every_other(bands, self.space.periodic):
            self.launcher.launch(
                kernels_splines.deposit_bands,
                count,
                [first_band, bands, self.cells, self._sorted, layout.for_kernels()],
                [node_charge],
                grain=max(1, GRAIN_OF_NEIGHBORS * bands // self.charge_count),
            )

    def _solve_far_field(self) -> None:
        at_once = 1 if self.launcher.device.is_cuda else kernels_splines.MIXED_AT_ONCE
        self.launcher.launch(
            kernels_splines.mix_groups,
            -(-self.node_count // at_once),
            [self._interaction, self.attraction, self.group_count, self.node_count, at_once],
            [self._node_charge, self._potential],
            grain=max(1, GRAIN * 8 // (at_once * self.group_count**2)),
        )
        self._convolution.apply(self._influence, self._potential)


def _threads_of_charge(count: int) -> int:
    """How many threads of a GPU share the neighbors of a charge, a power of two: fewer charges than it has threads leave some idle."""
    threads = 1
    while threads < MOST_THREADS_OF_CHARGE and 2 * threads * count <= THREADS_OF_GPU:
        threads *= 2
    return threads
