"""What is asked for, and what came of it.

Problems and the rules that their values keep, inks and directions; placements and their reports. NumPy only. Imports no
other room.
"""
