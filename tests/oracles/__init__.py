"""Independent formulations, against which the plants are checked."""
