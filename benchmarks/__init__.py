"""Benchmarks, run on demand: each prints a table of ratios that are measured in one run on one machine at a stated accuracy."""
