"""The generalised, spatial slider-crank of Rahman's thesis: parameters, kinematics, dynamics and the stateful plant."""
