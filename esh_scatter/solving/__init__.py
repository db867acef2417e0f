"""From a request to a result: a single job (``job.py``), a run in the window (``running.py``), and Live (``live.py``)."""
