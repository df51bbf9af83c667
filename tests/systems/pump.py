"""A pump as the FMU of another tool: without units, with outputs of other types, and without lists of dependencies."""

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


class Pump(Fmi2Slave):
    """A displacement pump against a pressure."""

    def __init__(self, **keywords):
        super().__init__(**keywords)
        self.displacement, self.pressure, self.omega, self.torque, self.valve, self.full = 1e-6, 2e5, 0.0, 0.0, 0, False
        for name, causality, variability in (
            ("displacement", "parameter", "fixed"),
            ("pressure", "parameter", "fixed"),
            ("omega", "input", "continuous"),
            ("torque", "output", "continuous"),
        ):
            kinds = {"causality": Fmi2Causality[causality], "variability": Fmi2Variability[variability]}
            self.register_variable(Real(name, **kinds))
        self.register_variable(Integer("valve", causality=Fmi2Causality.input))
        self.register_variable(Boolean("full", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        """Set the torque against the speed."""
        self.torque = -self.displacement * self.pressure * (1.0 if self.omega > 0.0 else -1.0)
        return True
