"""What simulating a robot takes beyond its URDF, as its YAML file has it."""

from dataclasses import dataclass, field

import numpy as np

from loco_drake.common.errors import InputError, check_number

# Lists have one number for each joint of a leg: hip, thigh, calf.
BY_JOINT = ("effort", "rotor_inertia", "gear_ratio", "kp", "kd")


@dataclass(kw_only=True)
class SimulationFile:
    """Motors and shapes; whatever is left out is derived, see docs/own_robot.md."""

    # Torque limits at the joints, N m. Default: the URDF's.
    effort: list[float] = field(default_factory=list)
    # Inertia of the rotors, kg m^2, and how much faster than the joints they turn.
    # Default: by the torque limits, as of the motors of Go2 and A1.
    rotor_inertia: list[float] = field(default_factory=list)
    gear_ratio: list[float] = field(default_factory=list)
    # Of the motors' PD: natural frequency, Hz, and damping ratio of each joint in the
    # stance.
    natural_frequency: float = 10.0
    damping_ratio: float = 1.0
    # Or its gains, N m/rad and N m s/rad.
    kp: list[float] = field(default_factory=list)
    kd: list[float] = field(default_factory=list)
    # Of the box that must not touch the ground, centred at the trunk's origin, m.
    # Default: by the hips.
    trunk_size: list[float] = field(default_factory=list)
    # Of the feet: Coulomb's coefficient, and stiffness, N/m. Default: a quarter of the
    # robot sinks in by .75 mm.
    foot_friction: float = 0.8
    foot_stiffness: float | None = None

    def check(self) -> None:
        """Raises InputError unless all is positive and complete."""
        for name in (*BY_JOINT, "trunk_size"):
            values = getattr(self, name)
            sound = np.isfinite(values).all() and min(values, default=1.0) > 0
            if values and not (len(values) == 3 and sound):
                raise InputError(
                    f"simulation.{name} must be three numbers above 0, not {values}."
                )
        for name, least, most in (
            ("natural_frequency", 1.0, 30.0),
            ("damping_ratio", 0.1, 5.0),
            ("foot_friction", 0.05, 3.0),
            ("foot_stiffness", 100.0, 1e7),
        ):
            if (value := getattr(self, name)) is not None:
                check_number(f"simulation.{name}", value, least, most)
        if bool(self.kp) != bool(self.kd):
            raise InputError("simulation.kp and simulation.kd need each other.")
        if self.gear_ratio and not self.rotor_inertia:
            raise InputError("simulation.gear_ratio needs simulation.rotor_inertia.")
