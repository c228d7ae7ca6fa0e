"""Readers of recorded motion, one module per source."""
