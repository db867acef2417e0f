"""The sampler: numbers in, numbers out. Never imports bpy or esh_scatter, and works without Blender.

Every public name has one import path, its module; the package ``esh`` offers the ones that users need. Modules lie in rooms, which
import each other in one direction only: ``solve`` knows ``solver`` and ``quality``, these know ``field`` and ``cascade``, then
``space``, ``surface`` and ``transforms``, and last ``device`` and ``problem``. ``files`` and ``drawing`` need none of these but
``problem``; ``scenes``, ``tiles`` and ``cli`` are above all. CONTRIBUTING.md has the whole table.
"""
