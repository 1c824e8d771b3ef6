"""One simulated drive in memory: everything but the pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array, Pose3, compose2, inverse2
from recon.model import Layout
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory
from recon.simulate.building import Building, build_building
from recon.simulate.check import check_plan
from recon.simulate.drive import Drive, drive_path
from recon.simulate.lidar import scan_times, simulate_lidar
from recon.simulate.odometry import simulate_odometry
from recon.simulate.plan import Plan
from recon.simulate.truth import true_layout


@dataclass(frozen=True)
class Simulation:
    """A drive through a building. map_from_plan: planar pose (3,); the map is the platform at the first scan.

    truth: the platform's pose at every scan. image_times: (N,) s; layout: the truth, map frame.
    """

    building: Building
    drive: Drive
    scans: Scans
    truth: Trajectory
    odometry: Trajectory
    map_from_plan: Array
    layout: Layout
    image_times: Array

    def platform_at(self, timestamps: Array) -> Array:
        """True map_from_platform (N, 3) at time stamps (N,) s."""
        plan_from_platform = self.drive.at(timestamps - self.building.plan.drive.start_time)
        return compose2(self.map_from_plan, plan_from_platform)


def run_simulation(plan: Plan, seed: int = 0) -> Simulation:
    """Drive through the plan; raises InputError where the plan cannot be built or driven.

    Scans, odometry and image times have random numbers of their own: none changes when another's settings do.
    """
    check_plan(plan)
    building, drive, start = build_building(plan), drive_path(plan), plan.drive.start_time
    times = scan_times(plan.lidar, drive, np.random.default_rng([seed, 1]))
    scans = simulate_lidar(building, drive, times, start, np.random.default_rng([seed, 2]))
    odometry = simulate_odometry(plan.odometry, drive, start, np.random.default_rng([seed, 3]))
    poses = drive.at(times)
    map_from_plan = inverse2(poses[0])
    truth = Trajectory(scans.timestamps, compose2(map_from_plan, poses))
    layout = true_layout(building, map_from_plan)
    image_times = start + _image_times(plan, drive, np.random.default_rng([seed, 4]))
    return Simulation(building, drive, scans, truth, odometry, map_from_plan, layout, image_times)


def simulate_scans(plan: Plan, seed: int = 0) -> tuple[Scans, Trajectory, Trajectory]:
    """Scans, the true trajectory (map frame, at every scan) and the odometry of a drive; raises InputError."""
    simulation = run_simulation(plan, seed)
    return simulation.scans, simulation.truth, simulation.odometry


def image_poses(simulation: Simulation, platform_from_camera: Pose3) -> list[Pose3]:
    """True map_from_camera of every image."""
    return [Pose3.from_planar(p) @ platform_from_camera for p in simulation.platform_at(simulation.image_times)]


def _image_times(plan: Plan, drive: Drive, rng: np.random.Generator) -> Array:
    if plan.camera.rate == 0.0:
        return np.zeros(0)
    period = 1.0 / plan.camera.rate
    times = np.arange(0.3 * period, drive.duration, period)
    return times + rng.uniform(-0.1 * period, 0.1 * period, len(times))
