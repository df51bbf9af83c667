"""Mechanisms for the tests that are not from the two theses; each is one folder, registered by one line."""
