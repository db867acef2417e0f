"""The command line ``esh-scatter``: reads recipes and images, writes placements and pictures.

Every command has a file ``*_command.py``. Needs no Blender.

May import ``device``, ``drawing``, ``files``, ``problem``, ``scenes``, ``solve.py``, ``solver`` and ``tiles``.
"""
