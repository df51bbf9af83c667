"""Placeholder"""
from .polish import Polished
def by_differential_evolution(normal, limits, *, seed, starts, n_jobs, progress): raise NotImplementedError
def by_simplex(normal, limits, *, seed, starts, n_jobs, progress): raise NotImplementedError
