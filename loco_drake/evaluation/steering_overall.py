"""The figures of steering of all labels together."""

from typing import Any

import numpy as np


def overall(labels: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Returns the figures of all labels together."""

    def of(name: str) -> list[float]:
        return [f[name] for f in labels.values() if f[name] is not None]

    known = [f for f in labels.values() if f["velocity_rmse_mps"] is not None]
    weights = [len(f["points"]) for f in known]
    result: dict[str, Any] = {
        name: float(np.sqrt(np.average(np.square(of(name)), weights=weights)))
        if known
        else None
        for name in ("velocity_rmse_mps", "yaw_rate_rmse_radps")
    }
    for name in (
        "latency_reference_s",
        "gait_change_max_s",
        "distance_from_plan_max_m",
        "plan_penetration_max_m",
    ):
        result[name] = max(of(name), default=None)
    for name in (
        "latency_robot_s",
        "gait_change_s",
        "plan_slip_median_mps",
        "stance_slip_median_mps",
    ):
        result[name] = float(np.median(of(name))) if of(name) else None
    for name in ("fall_rate", "normalized_return", "stretch"):
        result[name] = float(np.mean(of(name)))
    result["plan_joint_limit_violations"] = sum(of("plan_joint_limit_violations"))
    return result
