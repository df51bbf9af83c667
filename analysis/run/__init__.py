"""Running a mechanism: inputs, the compiled solver, trajectories, co-simulation, standard checks."""
