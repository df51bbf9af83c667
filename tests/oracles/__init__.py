"""Independent formulations of the mechanisms, against which the plants are checked."""
