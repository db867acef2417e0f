"""What a scatter leaves in the file: points, the node group that shows them, pins, and other programs' files."""
