"""Mechanisms of the tests: they have nothing to do with the two theses, and each is one folder and one line."""
