"""Run archives of SSP in the masters of the tests.

Each function runs in a process of its own and imports there what it needs. Its arguments are the archive, the communication
step and the number of steps, the names of outputs, and options of the master. The function returns the outputs at the end.
Masters that do not read archives are wired by hand.
"""

from __future__ import annotations

from typing import Any


def by_fmpy(archive: str, step: float, count: int, names: list[str], parameter_set: bool = True) -> Any:
    """Run the archive by FMPy's runner of SSP, which takes start values as one set and records only connected variables."""
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import Parameter, ParameterSet
    from ssp_archive import unpack

    starts = unpack(archive).starts
    values = {f"{part}.{name}": value for part in starts for name, value in starts[part].items()}
    start = ParameterSet(parameters=[Parameter(name=name, value=value) for name, value in values.items()])
    # a row has the outputs at the end of the step that begins at its time
    end = (count - 0.5) * step
    run = simulate_ssp(archive, stop_time=end, step_size=step, parameter_set=start if parameter_set else None)
    return {name: float(run[-1][name]) for name in names if name in run.dtype.names}


def by_libcosimpy(archive: str, step: float, count: int, names: list[str]) -> Any:
    """Run the unpacked archive by libcosim's fixed-step algorithm."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from ssp_archive import unpack

    references = unpack(archive).references
    execution = CosimExecution.from_ssp_file("unpacked", round(step * 1e9))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    assert execution.step(count)
    found = {}
    for info in execution.slave_infos():
        part = info.name.decode() if isinstance(info.name, bytes) else info.name
        of = {f"{part}.{name}": reference for name, reference in references[part].items()}
        own = [name for name in names if name in of]
        found |= dict(zip(own, observer.last_real_values(info.index, [of[name] for name in own])))
    return found


def by_ecco(archive: str, stop_time: float, tolerance: float, bond: list[str], names: list[str]) -> Any:
    """Run the FMUs of an archive by libcosim's ECCO algorithm, with a power bond; it chooses its steps.

    ``bond`` names an effort and the input to which it goes, a flow and the input to which it goes. The result has all values
    at all communication points.
    """
    from libcosimpy.CosimAlgorithm import CosimAlgorithm, EccoParams
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave
    from ssp_archive import unpack

    content = unpack(archive)
    steps = {"step_size": 1e-5, "min_step_size": 1e-6, "max_step_size": 1e-2}
    rates = {"min_change_rate": 0.2, "max_change_rate": 1.5}
    parameters = EccoParams(abs_tolerance=tolerance, rel_tolerance=tolerance, **steps, **rates)
    algorithm = CosimAlgorithm.create_ecco_algorithm(parameters)
    execution = CosimExecution.from_algorithm(algorithm)
    slaves = {}
    for part, fmu in content.fmus.items():
        slaves[part] = execution.add_local_slave(CosimLocalSlave(fmu_path=fmu, instance_name=part))
        for name, value in content.starts[part].items():
            put = execution.integer_initial_value if isinstance(value, int) else execution.real_initial_value
            assert put(slaves[part], content.references[part][name], value)

    def end(name: str) -> tuple[int, int]:
        part, _, port = name.partition(".")
        return slaves[part], content.references[part][port]

    for (part, port), (of, output) in content.wires.items():
        assert execution.connect_real_variables(*end(f"{of}.{output}"), *end(f"{part}.{port}")) == 0
    effort, effort_to, flow, flow_to = map(end, bond)
    assert algorithm.add_power_bond(effort[0], effort[1], flow_to[1], flow[0], flow[1], effort_to[1]) == 0
    observer = CosimObserver.create_time_series(buffer_size=100_000)
    execution.add_observer(observer)
    # the algorithm reads the inputs of the bond only if they are observed
    for name in (*bond, *names):
        observer.start_time_series(*end(name), CosimVariableType.REAL)
    assert execution.simulate_until(round(stop_time * 1e9))
    found = {}
    for name in (*bond, *names):
        slave, reference = end(name)
        times, _, values = observer.time_series_real_samples(slave, reference, sample_count=100_000, from_step=0)
        found[name], found["time"] = list(values), [time * 1e-9 for time in times]
    return found


def by_ecospy(archive: str, step: float, count: int, names: list[str]) -> Any:
    """Run the archive by ecos, with the start values of the parameter sets named "default"."""
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=archive, step_size=step) as simulation:
        simulation.init(parameter_set="default")
        simulation.step(count)
        found = {name: simulation.get_real(name.replace(".", "::", 1)) for name in names}
        simulation.terminate()
    return found


def by_cofmupy(archive: str, step: float, count: int, names: list[str], iterative: bool = False) -> Any:
    """Run the FMUs by CoFMUPy, wired by hand.

    It sets only Reals, so that the FMUs must have the values of their modes as start values; and it sets all inputs.
    """
    import sys

    sys.path.insert(0, f"{sys.prefix}/cofmupy")  # with the version of FMPy that CoFMUPy needs
    from cofmupy import Coordinator
    from ssp_archive import unpack

    content = unpack(archive)
    fmus, connections = [], []
    for part, fmu in content.fmus.items():
        start = {name: value for name, value in content.starts[part].items() if isinstance(value, float)}
        fmus.append({"id": part, "name": part, "path": fmu, "initialization": start})
    for (part, port), (of, output) in content.wires.items():
        ends = {"source": {"id": of, "variable": output}, "target": {"id": part, "variable": port}}
        connections.append({key: value | {"type": "fmu", "unit": ""} for key, value in ends.items()})
    coordinator = Coordinator()
    coordinator.start({"fmus": fmus, "connections": connections, "cosim_method": "jacobi", "iterative": iterative})
    for _ in range(count):
        coordinator.master.do_step(step)
    return {name: coordinator.master.get_variable(tuple(name.split(".", 1)))[0] for name in names}


def by_pathsim(archive: str, step: float, count: int, names: list[str]) -> Any:
    """Run the FMUs by PathSim's blocks, wired by hand.

    A block shows the outputs of a step only at its next step, and only then its neighbour receives them.
    """
    from pathsim import Connection, Simulation
    from pathsim.blocks import Constant
    from pathsim_fmi.blocks import CoSimulationFMU
    from ssp_archive import unpack

    content = unpack(archive)
    blocks = {part: CoSimulationFMU(fmu, part, content.starts[part], dt=step) for part, fmu in content.fmus.items()}
    others, connections = [], []
    for part, block in blocks.items():
        for place, name in enumerate(block.fmu_wrapper.input_refs):
            if (part, name) in content.wires:
                of, output = content.wires[part, name]
                source = blocks[of][list(blocks[of].fmu_wrapper.output_refs).index(output)]
            else:
                others.append(source := Constant(content.starts[part].get(name, 0.0)))
            connections.append(Connection(source, block[place]))
    simulation = Simulation([*others, *blocks.values()], connections, dt=step, log=False)
    simulation.run((count - 2.5) * step)
    found: dict[str, float] = {}
    for part, block in blocks.items():
        values = zip(block.fmu_wrapper.output_refs, map(float, block.fmu_wrapper.get_outputs_as_array()))
        found |= {f"{part}.{name}": value for name, value in values if f"{part}.{name}" in names}
    return found


def by_linkwork(
    archive: str, step: float, count: int, names: list[str], coupling: str = "hold", share: float | None = None
) -> Any:
    """Run the archive by our own master."""
    from analysis.systems import read_ssp, run_system

    run = run_system(read_ssp(archive), step=step, stop_time=count * step, coupling=coupling, share=share)
    return {name: float(run[name][-1]) for name in names}
