"""The report: one page of all results beside the published ones."""
