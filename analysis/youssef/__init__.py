"""Youssef's own theory: the linearised slider equation, harmonic balance, Hill's determinant, the workspace."""
