"""The report: one page of everything that was measured, beside what is published."""
