"""Where kernels run, on the CPU's threads or on a GPU, and how long they take. Imports no other room."""
