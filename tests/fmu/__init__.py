"""Tests of the FMU: what is inside, what it computes, and how it answers a master, each run in a process of its own."""
