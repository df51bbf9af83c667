"""The five-bar slider of Youssef's thesis: parameters, kinematics, dynamics and the stateful plant."""
