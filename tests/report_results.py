"""A small folder of results, made by hand, for the report."""

import json

LABELS = ("dog-trot", "solo8-wave")


def retargeting(**changes):
    figures = {
        "stance_slip_median_mps": 0.0123,
        "penetration_max_m": 0.0017,
        "joint_limit_violations": 0,
        "joint_speed_ratio_max": 0.91,
        "toe_error_rmse_m": 0.0004,
        "correction_rmse_m": 0.0042,
        "stride_period_error": 0.012,
        "phase_lag_error": 0.034,
        "duty_factor_error": 0.056,
        "clips": 7,
        **changes,
    }
    labels = {label: dict(figures) for label in LABELS}
    return {"labels": labels, "all": figures, "frames_per_second": 321.0}


def tokenizer(**changes):
    figures = {"joint_rmse_rad": 0.0271, "toe_error_rmse_m": 0.0163, **changes}
    labels = {label: dict(figures) for label in LABELS}
    return {"labels": labels, "all": figures, "codebook_use": 0.93}


def tracking(robot="go2", **changes):
    """Returns of 60 and 94; what changes does so for all gaits alike."""
    figures = {
        "normalized_return": 77.0,
        "fall_rate": 0.015,
        "joint_rmse_rad": 0.03,
        "base_position_rmse_m": 0.044,
        "base_orientation_rmse_rad": 0.05,
        "stance_slip_median_mps": 0.07,
        "stretch": 1.021,
        "episodes": 20,
        **changes,
    }
    labels = {
        label: {**figures, "normalized_return": value}
        for label, value in zip(LABELS, (60.0, 94.0), strict=True)
    }
    return {
        "robot": robot,
        "reference": "generated",
        "contact": "similar",
        "time_step_s": 0.01,
        "duration_s": 10.0,
        "labels": labels,
        "all": figures,
        "real_time_factor": 6.5,
    }


STEERED = ("dog-trot", "mpc-trot")


def steering(robot="go2", **changes):
    """Two gaits, with the middle and one end of their grid; changes are of all alike.

    Errors are .06 and .10 m/s, ranges the same.
    """
    points = [
        {"command": [0.75, 0.0, 0.0], "velocity": [0.78, 0.04, 0.01], "fell": False},
        {"command": [2.0, 0.0, 0.0], "velocity": None, "fell": True},
    ]
    figures = {
        "velocity_rmse_mps": 0.082,
        "yaw_rate_rmse_radps": 0.05,
        "latency_reference_s": 0.26,
        "latency_robot_s": 0.9,
        "gait_change_s": 1.1,
        "gait_change_max_s": 1.7,
        "fall_rate": 0.03,
        "normalized_return": 88.0,
        "stretch": 1.01,
        "distance_from_plan_max_m": 0.31,
        "stance_slip_median_mps": 0.04,
        "plan_slip_median_mps": 0.011,
        "plan_penetration_max_m": 0.0017,
        "plan_joint_limit_violations": 0,
        **changes,
    }
    ends = {
        "forward_mps": [-0.5, 2.0],
        "sideways_mps": [-0.3, 0.3],
        "yaw_rate_radps": [-1.0, 0.9],
    }
    own = {"range": ends, "points": points, "steps": 8, "steps_covered": 7, "drives": 2}
    labels = {
        label: {**figures, **own, "velocity_rmse_mps": error}
        for label, error in zip(STEERED, (0.06, 0.10), strict=True)
    }
    return {"robot": robot, "labels": labels, "all": figures}


def robustness(robot="go2"):
    """Two gaits, pushed from the left and on slippery ground."""

    def curve(*levels):
        return {
            "levels": levels,
            "success": [1.0, 0.75, 0.25],
            "falls": [0.0, 0.25, 0.5],
            "episodes": [2, 4, 4],
            "level_80_percent": levels[1],
            "level_80_percent_interval": [levels[0], levels[2]],
            "level_80_percent_beyond": False,
        }

    pushes = curve(0.0, 8.0, 16.0)
    ways = ("forward", "back", "left", "right")
    curves = {name: pushes for name in ("push", *(f"push_{way}" for way in ways))}
    figures = {
        "impulse_80_percent_ns": 12.34,
        "impulse_80_percent_interval_ns": [9.87, 15.6],
        "impulse_80_percent_beyond": False,
        "recovery_s": 0.456,
        "success": {"undisturbed": 1.0, "push": 0.5, "friction": 0.52},
        "episodes": 10,
        "curves": {**curves, "friction": curve(0.8, 0.5, 0.3)},
    }
    labels = {label: figures for label in LABELS}
    return {"robot": robot, "seeds": 3, "labels": labels, "all": figures}


def learning(robot="go2"):
    curve = {
        "steps": [1000, 2000, 4_500_000],
        "seconds": [1.0, 2.0, 7200.0],
        "return": {"dog-trot": [5.0, 20.0, 61.0], "solo8-wave": [None, 30.0, 93.0]},
    }
    return {"robot": robot, "learning": curve}


def write_results(folder, **files):
    """Writes files by name, with _ for -, and returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        path = folder / f"{name.replace('_', '-')}.json"
        path.write_text(json.dumps(content))
    return folder
