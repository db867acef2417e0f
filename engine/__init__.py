"""The sampler: numbers in, numbers out. Never imports bpy or esh_scatter, and works without Blender.

Every public name has one import path, its module; the package ``esh`` offers the ones that users need. Modules lie in rooms, of
which each says whom it may import, never upwards: ``solve`` knows ``solver`` and ``quality``, these know ``field``, then
``space``, ``transforms``, and last ``device`` and ``problem``; beside them are ``surface``, ``drawing`` and ``files``.
"""
