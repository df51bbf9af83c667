"""Benchmarks, run on demand: each prints a table, ratios within one run on one machine at a stated accuracy."""
