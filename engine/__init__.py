"""The engine: solves placement problems without Blender. Takes numbers and arrays, and never imports ``bpy`` or ``esh_scatter``.

The engine is divided into packages, called rooms, which import each other in one direction only. From the bottom up:

- ``problem``: what is asked for, and the result. ``device``: how kernels run.
- ``transforms``, ``space``, ``surface``, ``heat``: Fourier transforms, the rectangular domain, triangle meshes, smoothing on these.
- ``field`` and ``cascade``: fast forces in the plane and on surfaces.
- ``quality``: measures placements, independently of how they were made.
- ``model``, ``motion``, ``contact``, ``descent``, ``edits``, ``solver``: the solver, from compiled tables to whole runs, at whose end
  ``solver`` has ``quality`` make the report.
- ``files`` and ``drawing`` read, write and draw; of the rooms above they need ``problem`` only.
- ``scenes``, ``tiles`` and ``cli``: many scenes, huge domains, the command line.

CONTRIBUTING.md has the whole table, and says which room may import which. Every public name has one import path, its module;
the package ``esh`` exports those that users need.
"""
