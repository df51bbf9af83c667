"""Run FMUs in the masters of the tests.

Each function runs in a process of its own and imports there what it needs. It runs a case for 100 steps of 1 ms. A case has the
start values of reals and of integers, the name of an input that changes after 50 steps, and its new value. The result has the
outputs at the end as ``end``, the time and `solver.status` if the master tells them, and the messages that reach the user as
``said``. Masters that are called step by step also take another step, and ``given``, the inputs that change before each step.
"""

from __future__ import annotations

from typing import Any


def by_fmpy(fmu: str, case: list[Any], outputs: list[str], kind: str) -> Any:
    """Run the case by FMPy's own simulate_fmu; model exchange by CVode."""
    import numpy as np
    from fmpy import read_model_description, simulate_fmu
    from fmpy.fmi1 import FMICallException

    reals, integers, changed, later = case

    names = [v.name for v in read_model_description(fmu).modelVariables if v.causality == "input"]
    before = [reals.get(name, 0.0) for name in names]
    after = [later if name == changed else reals.get(name, 0.0) for name in names]
    # the jump is exactly at a communication point: at a rounded time it would cause a step of its own
    half = 50 * 1e-3
    rows = [(0.0, *before), (half, *before), (half, *after), (0.1, *after)]
    signals = np.array(rows, dtype=[("time", float), *((name, float) for name in names)])
    said: list[str] = []
    try:
        result = simulate_fmu(
            fmu,
            fmi_type=kind,
            stop_time=0.1,
            step_size=1e-3,
            output_interval=1e-3,
            relative_tolerance=1e-10 if kind == "ModelExchange" else None,
            start_values=reals | integers,
            input=signals,
            output=[*outputs, "solver.status"],
            debug_logging=True,
            # the message is the last argument in FMI 2.0 and 3.0
            logger=lambda *arguments: said.append(arguments[-1].decode()),
        )
    except FMICallException as error:
        return {"said": [*said, str(error)]}
    last = result[-1]
    told = {"status": int(last["solver.status"]), "said": said}
    return {"end": {name: float(last[name]) for name in outputs}, "time": float(last["time"])} | told


def by_fmpy_with(fmu: str, case: list[Any], outputs: list[str], option: str) -> Any:
    """Run the case in co-simulation by FMPy with an option of `simulate_fmu`; the input changes linearly from the start on.

    With the option "early_return_allowed" a callback ends steps early.
    """
    import numpy as np
    from fmpy import extract, instantiate_fmu, read_model_description, simulate_fmu
    from fmpy.fmi3 import fmi3IntermediateUpdateCallback

    reals, integers, changed, later = case

    @fmi3IntermediateUpdateCallback
    def update(environment: Any, time: float, *flags_and_answer: Any) -> None:
        *_, requested, until = flags_and_answer
        requested[0], until[0] = True, time

    description = read_model_description(fmu)
    ramp = np.array([(0.0, reals[changed]), (0.1, later)], dtype=[("time", float), (changed, float)])
    options: dict[str, Any] = {"stop_time": 0.1, "step_size": 1e-3, "output_interval": 1e-3}
    options |= {"output": outputs, "input": ramp}
    if option == "fmu_state":
        made = instantiate_fmu(extract(fmu), description, "CoSimulation")
        half = options | {"stop_time": 0.05, "set_stop_time": False, "terminate": False}
        simulate_fmu(fmu, fmu_instance=made, start_values=reals | integers, **half)
        options |= {"start_time": 0.05, "initialize": False, "fmu_instance": made, "fmu_state": made.getFMUState()}
    else:
        options |= {"start_values": reals | integers, option: True}
    if option == "early_return_allowed":
        early = {"early_return_allowed": True, "intermediate_update": update}
        options["fmu_instance"] = instantiate_fmu(extract(fmu), description, "CoSimulation", **early)
    run = simulate_fmu(fmu, model_description=description, **options)
    return {"end": {name: float(run[-1][name]) for name in outputs}, "time": float(run[-1]["time"])}


def by_libcosimpy(
    fmu: str, case: list[Any], outputs: list[str], kind: str, step: float = 1e-3, given: list[Any] | None = None
) -> Any:
    """Run the case by libcosim's fixed-step algorithm."""
    import zipfile
    from xml.etree import ElementTree

    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    reals, integers, changed, later = case
    given = given or [{changed: later} if k == 50 else {} for k in range(100)]

    log_output_level(CosimLogLevel.DEBUG)
    root = ElementTree.fromstring(zipfile.ZipFile(fmu).read("modelDescription.xml"))
    reference = {v.get("name"): int(v.get("valueReference")) for v in root.find("ModelVariables")}
    execution = CosimExecution.from_step_size(round(step * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=fmu, instance_name="slider"))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    override = CosimManipulator.create_override()
    execution.add_manipulator(override)
    for name, value in reals.items():
        assert execution.real_initial_value(slave, reference[name], value)
    for name, value in integers.items():
        assert execution.integer_initial_value(slave, reference[name], value)
    good = True
    for values in given:
        override.slave_real_values(slave, [reference[name] for name in values], list(values.values()))
        good = good and execution.step(1)
    return {
        "end": dict(zip(outputs, observer.last_real_values(slave, [reference[name] for name in outputs]))),
        "time": execution.status().current_time * 1e-9,
        "status": observer.last_integer_values(slave, [reference["solver.status"]])[0],
        "said": [] if good else ["the step failed"],
    }


def by_ecospy(
    fmu: str, case: list[Any], outputs: list[str], kind: str, step: float = 1e-3, given: list[Any] | None = None
) -> Any:
    """Run the case by ecos."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    reals, integers, changed, later = case
    given = given or [{changed: later} if k == 50 else {} for k in range(100)]

    with EcosSimulationStructure() as structure:
        structure.add_model("slider", fmu)
        structure.add_parameter_set("case", {f"slider::{name}": value for name, value in (reals | integers).items()})
        with EcosSimulation(structure=structure, step_size=step) as simulation:
            simulation.init(parameter_set="case")
            for values in given:
                for name, value in values.items():
                    simulation.set_real(f"slider::{name}", value)
                time = simulation.step(1)
            found = {
                "end": {name: simulation.get_real(f"slider::{name}") for name in outputs},
                "time": time,
                "status": simulation.get_integer("slider::solver.status"),
                "said": [simulation.get_string("slider::solver.message")],
            }
            simulation.terminate()
    return found


def by_cofmupy(
    fmu: str, case: list[Any], outputs: list[str], kind: str, step: float = 1e-3, given: list[Any] | None = None
) -> Any:
    """Run the case by CoFMUPy, which sets only Reals, and all inputs: to zero if it is given no value."""
    import sys

    reals, integers, changed, later = case
    given = given or [{changed: later} if k == 50 else {} for k in range(100)]

    sys.path.insert(0, f"{sys.prefix}/cofmupy")  # with the version of FMPy that CoFMUPy needs
    from cofmupy import Coordinator
    from fmpy.fmi1 import FMICallException

    assert not integers
    slider = {"id": "slider", "name": "slider", "path": fmu, "initialization": reals}
    coordinator = Coordinator()
    coordinator.start({"fmus": [slider], "connections": [], "cosim_method": "jacobi", "iterative": False})
    said = []
    for values in given:
        inputs = {"slider": {name: [value] for name, value in values.items()}} if values else None
        try:
            coordinator.master.do_step(step, input_dict=inputs)
        except FMICallException as error:
            said.append(str(error))
            break
    handler = coordinator.master.fmu_handlers["slider"]
    return {
        "end": {name: handler.get_variable(name)[0] for name in outputs},
        "time": coordinator.master.current_time,
        "status": handler.get_variable("solver.status")[0],
        "said": said,
    }


def by_pathsim(fmu: str, case: list[Any], outputs: list[str], kind: str) -> Any:
    """Run the case by PathSim; model exchange by its Runge-Kutta method of order 5."""
    from fmpy.fmi1 import FMICallException
    from pathsim import Connection, Simulation
    from pathsim.blocks import Source
    from pathsim.solvers import RKDP54
    from pathsim_fmi.blocks import CoSimulationFMU, ModelExchangeFMU

    reals, integers, changed, later = case

    exchange = kind == "ModelExchange"
    start = reals | integers
    block = ModelExchangeFMU(fmu, "slider", start) if exchange else CoSimulationFMU(fmu, "slider", start, dt=1e-3)
    wrapper = block.fmu_wrapper
    # in the middle of a step: the inputs of one are those at its beginning
    half = 0.05 if exchange else 0.0495

    def source(name: str) -> Any:
        before = reals.get(name, 0.0)
        return Source(lambda t: later if name == changed and t > half else before)

    sources = {name: source(name) for name in wrapper.input_refs}
    connections = [Connection(source, block[place]) for place, source in enumerate(sources.values())]
    blocks = [*sources.values(), block]
    said = []
    try:
        if exchange:
            tolerances = {"tolerance_lte_abs": 1e-12, "tolerance_lte_rel": 1e-10}
            simulation = Simulation(blocks, connections, dt=1e-4, log=False, Solver=RKDP54, **tolerances)
            # a step of the solver may not go over the jump
            simulation.run(0.05)
            simulation.run(0.05, reset=False)
        else:
            simulation = Simulation(blocks, connections, dt=1e-3, log=False)
            # it steps at the beginning of each period, at 0.099 s for the last time
            simulation.run(0.0985)
    except (FMICallException, RuntimeError) as error:
        said.append(str(error))
    read = wrapper.fmu.getInteger if wrapper.fmi_version == "2.0" else wrapper.fmu.getInt32
    return {
        "end": dict(zip(wrapper.output_refs, map(float, wrapper.get_outputs_as_array()))),
        "time": float(simulation.time) + (0.0 if exchange else 1e-3),
        "status": read([wrapper.variable_map["solver.status"].valueReference])[0],
        "said": said,
    }
