"""Numerical tools that know no mechanism: tracing, exact derivatives, dual numbers, Fourier series, continuation, curves."""
