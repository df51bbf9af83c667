"""Periodic motions: orbits, Floquet multipliers, branches, resonance, stability charts."""
