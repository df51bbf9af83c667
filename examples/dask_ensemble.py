"""Simulate an ensemble on a Dask cluster: the steady travel of the slider for many springs and crank speeds.

The cluster here is a local one. To use another one, give its scheduler's address to `distributed.Client`. Nothing else
changes: `simulate_many` hands its batches to joblib, and joblib hands them to the chosen backend.

    python examples/dask_ensemble.py --mechanisms 2000 --workers 2
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from math import pi

import joblib
import numpy as np
from distributed import Client, LocalCluster

from analysis import Inputs, simulate_many
from linkwork.five_bar.published import TABLE_3_1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mechanisms", type=int, default=1000, help="how many (default: %(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="processes of the cluster (default: %(default)s)")
    options = parser.parse_args()

    source = np.random.default_rng(1)
    stiffness = source.uniform(500.0, 2000.0, options.mechanisms)
    speed_rpm = source.uniform(200.0, 500.0, options.mechanisms)
    mechanisms = [replace(TABLE_3_1, slider_stiffness=float(k)) for k in stiffness]
    inputs = [Inputs(speed=float(n) * pi / 30.0) for n in speed_rpm]

    with (
        LocalCluster(n_workers=options.workers, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster),
        joblib.parallel_config(backend="dask"),
    ):
        ensemble = simulate_many(mechanisms, inputs, stop_time=2.0, step=2e-3, tolerance=1e-8)

    # values after a run has ended early are masked
    steady = ensemble.output("slider.position")[:, ensemble.time > 1.5]
    travel_mm = 1e3 * np.ma.ptp(steady, axis=1)
    widest = int(np.argmax(travel_mm))
    print(f"{len(ensemble)} mechanisms, {np.count_nonzero(ensemble.status)} of them ended early")
    print(
        f"largest travel {travel_mm[widest]:.2f} mm, at {stiffness[widest]:.0f} N/m and {speed_rpm[widest]:.0f} rpm; "
        f"median {np.ma.median(travel_mm):.2f} mm"
    )


if __name__ == "__main__":
    main()
