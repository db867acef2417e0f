"""From a request to a result: one job, a run in the window, Live."""
